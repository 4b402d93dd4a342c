"""Run atheris on each target for a bounded time, then time the inputs: `python -m fuzz`."""

import argparse
import json
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import atheris

CORPUS = Path(__file__).parent / "corpus"
FOUND = Path("out/fuzz")
"""Folder of new inputs and crashes; useful ones are moved to the corpus by hand."""
COUNTS = FOUND / "executed.json"
"""Inputs of each target in all runs, until the folder is removed."""

MAX_INPUT_BYTES = 4096
KILOBYTE = 1000
REPEATS = 5


def main() -> None:
    """Fuzz all targets or those named, each in a process of its own; exit code 1 if one fails."""
    parser = argparse.ArgumentParser(prog="python -m fuzz", description=__doc__)
    parser.add_argument("target", nargs="*", help="default: all")
    parser.add_argument("--seconds", type=int, default=20, help="for each target")
    parser.add_argument("--phase", choices=["fuzz", "time"], help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.phase == "fuzz":
        fuzz(arguments.target[0], arguments.seconds)
    elif arguments.phase == "time":
        sys.exit(time_inputs(arguments.target[0]))
    failed = []
    for name in arguments.target or sorted(folder.name for folder in CORPUS.iterdir()):
        for phase in ("fuzz", "time"):
            command = [sys.executable, "-m", "fuzz", name, "--phase", phase]
            command += ["--seconds", str(arguments.seconds)]
            done = subprocess.run(  # noqa: S603 (ourselves)
                command, check=False, stderr=subprocess.PIPE, text=True, errors="replace"
            )
            sys.stderr.write(done.stderr)
            if phase == "fuzz":
                count(name, done.stderr)
            if done.returncode:
                failed.append(f"{name} ({phase})")
    sys.stdout.write(COUNTS.read_text(encoding="utf-8"))
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


def count(name: str, statistics: str) -> None:
    """Add the inputs that libFuzzer states to those of all runs before."""
    counts = json.loads(COUNTS.read_text(encoding="utf-8")) if COUNTS.exists() else {}
    executed = re.search(r"number_of_executed_units: (\d+)", statistics)
    counts[name] = counts.get(name, 0) + (int(executed[1]) if executed else 0)
    COUNTS.write_text(json.dumps(counts, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def fuzz(name: str, seconds: int) -> None:
    """Fuzz one target. Does not return: libFuzzer exits the process."""
    with atheris.instrument_imports(include=["onboard"]):
        from fuzz.targets import TARGETS  # noqa: PLC0415 (after this, it cannot be instrumented)
    found = FOUND / name
    found.mkdir(parents=True, exist_ok=True)
    atheris.Setup(
        [
            f"fuzz {name}",
            str(found),
            str(CORPUS / name),
            f"-max_total_time={seconds}",
            f"-max_len={MAX_INPUT_BYTES}",
            f"-artifact_prefix={FOUND}/{name}-",
            "-timeout=10",
            "-print_final_stats=1",
            "-verbosity=0",
        ],
        TARGETS[name].feed,
    )
    atheris.Fuzz()


def time_inputs(name: str) -> int:
    """Time each input, alone and repeated up to a kilobyte, without coverage.

    Returns:
        1 if an input takes too long, else 0.
    """
    from fuzz.targets import TARGETS  # noqa: PLC0415 (not for the fuzzing)

    target = TARGETS[name]
    slow = []
    for path in sorted((CORPUS / name).iterdir()) + sorted((FOUND / name).iterdir()):
        whole = path.read_bytes()
        for data in (whole, whole * (KILOBYTE // (len(whole) or KILOBYTE))):
            best_s = min(_time_s(target.feed, data) for _ in range(REPEATS))
            if best_s > target.max_s_per_kilobyte * max(1.0, len(data) / KILOBYTE):
                slow.append(f"{path}: {best_s * 1e3:.2f} ms for {len(data)} bytes of it")
    sys.stdout.write("\n".join(slow or [f"{name}: no input takes too long"]) + "\n")
    return bool(slow)


def _time_s(feed: Callable[[bytes], None], data: bytes) -> float:
    start = time.thread_time()
    feed(data)
    return time.thread_time() - start


if __name__ == "__main__":
    main()
