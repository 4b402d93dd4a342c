"""Changes each comparison of the packages in `[tool.mutmut]`: a test must fail for every change.

    make mutate

Takes some minutes. `python -m mutmut show NAME` prints a change that no test notices.
"""

import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
MUTMUT = (sys.executable, "-m", "mutmut")

EQUIVALENT = frozenset({
    "if speed is not None and closing_m_s is not None and (sigma_m_s or 1.0) <= MAX_SIGMA_M_S:",
    "column = full[1:, 0] / np.where(pivot > 0.0, pivot, 2.0)",
})  # fmt: skip
"""Changed lines that mean the same: the limit is 1.0; such a pivot has been refused."""


def main() -> None:
    """Run all changes; exit code 1 if no test fails for one that means something else."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    packages = tomllib.loads(text)["tool"]["mutmut"]["source_paths"]
    every = [f"{package.replace('/', '.')}.*" for package in packages]
    subprocess.run([*MUTMUT, "run", *every], check=True, cwd=ROOT)  # noqa: S603 (of pyproject.toml)
    found = (line.strip().partition(": ") for line in _printed("results").splitlines())
    unnoticed = [(name, status) for name, _, status in found if not _is_equivalent(name)]
    for name, status in unnoticed:
        sys.stdout.write(f"{name}: {status}\n")
    sys.exit(bool(unnoticed))


def _is_equivalent(name: str) -> bool:
    lines = _printed("show", name).splitlines()
    added = {line[1:].strip() for line in lines if line.startswith("+") and line[1:2] != "+"}
    return bool(added) and added <= EQUIVALENT


def _printed(*arguments: str) -> str:
    command = [*MUTMUT, *arguments]
    return subprocess.run(  # noqa: S603 (names of changes)
        command, check=True, cwd=ROOT, capture_output=True, text=True
    ).stdout


if __name__ == "__main__":
    main()
