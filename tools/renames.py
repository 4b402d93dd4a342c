"""Applies a table of renames to traces and recordings, to show that a rename changed nothing else.

python -m tools.renames run FOLDER            every scenario in virtual time, seeds 1 to 3
python -m tools.renames compare BEFORE AFTER  two such folders, of two versions of the code
python -m tools.renames convert FILE...       recordings of the black box, rewritten in place
"""

import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import typer
import yaml
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.catalogue import scenario_names
from sim_rig.scenario.schema import load_scenario

SEEDS = (1, 2, 3)
TABLE: Mapping[str, Any] = yaml.safe_load(
    Path(__file__).with_name("renames.yaml").read_text(encoding="utf-8")
)


def renamed(value: Any, field: str = "") -> Any:
    """The JSON `value` of `field` under the new names."""
    if isinstance(value, dict):
        named = ((TABLE["fields"].get(name, name), item) for name, item in value.items())
        return {name: renamed(item, name) for name, item in named if name is not None}
    if isinstance(value, list):
        return [renamed(item, field) for item in value]
    if not isinstance(value, str):
        return value
    words = TABLE["kinds"] if field == "kind" else TABLE["values"].get(field, {})
    prefixes = TABLE["prefixes"].get(field, {})
    for old, new in prefixes.items():
        if value.startswith(old):
            return new + value.removeprefix(old)
    return words.get(value, value)


def run(folder: Path, names: list[str]) -> None:
    """Write the traces of these scenarios, or of all, with every seed."""
    for name in names or scenario_names():
        for seed in SEEDS:
            run_virtual(load_scenario(name), seed).write(folder / name / str(seed))
        typer.echo(name)


def differences(before: Path, after: Path) -> Iterator[str]:
    """Yield one line for each trace that differs in more than the renames."""
    paths = {_new_path(path.relative_to(before)): path for path in before.rglob("*.jsonl")}
    names = paths.keys() | {path.relative_to(after) for path in after.rglob("*.jsonl")}
    for name in sorted(names):
        if name not in paths or not (after / name).exists():
            yield f"{name}: only in one of the two"
            continue
        old, new = _lines(paths[name]), _lines(after / name)
        for number, (was, now) in enumerate(zip(old, new, strict=False), 1):
            if renamed(was) != now:
                yield f"{name}, line {number}:\n  {renamed(was)}\n  {now}"
                break
        else:
            if len(old) != len(new):
                yield f"{name}: {len(old)} and {len(new)} lines"


def convert(path: Path) -> None:
    """Rewrite one segment of a black box under the new names."""
    beside = path.with_suffix(".converted")
    with path.open("rb") as source, beside.open("wb") as target:
        reader = make_reader(source)
        writer = Writer(target, compression=CompressionType.ZSTD)
        writer.start(profile="", library="onboard")
        for metadata in reader.iter_metadata():
            content = dict(metadata.metadata)
            content["head"] = json.dumps(renamed(json.loads(content["head"])))
            writer.add_metadata(metadata.name, content)
        channels: dict[int, int] = {}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if channel.id not in channels:
                assert schema is not None  # noqa: S101 (the black box gives every topic one)
                title = renamed(schema.name, "title")
                data = json.dumps(renamed(json.loads(schema.data))).encode()
                schema_id = writer.register_schema(title, schema.encoding, data)
                topic = _topic(channel.topic)
                channels[channel.id] = writer.register_channel(topic, "json", schema_id)
            data = json.dumps(renamed(json.loads(message.data)), separators=(",", ":")).encode()
            writer.add_message(channels[channel.id], message.log_time, data, message.publish_time)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap's omission
    beside.replace(path)


def _new_path(path: Path) -> Path:
    """The path of a trace, which begins with the scenario's name, under the new name."""
    scenario, *rest = path.parts
    return Path(TABLE["scenarios"].get(scenario, scenario), *rest)


def _topic(topic: str) -> str:
    folder, _, kind = topic.rpartition("/")
    return str(TABLE["topics"].get(topic, f"{folder}/{TABLE['kinds'].get(kind, kind)}"))


def _lines(path: Path) -> list[Any]:
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def main() -> int:
    """Run one of the commands of the module's head."""
    match sys.argv[1:]:
        case ["run", folder, *names]:
            run(Path(folder), names)
        case ["compare", before, after]:
            found = list(differences(Path(before), Path(after)))
            typer.echo("\n".join([*found, f"{len(found)} traces differ"]))
            return 1 if found else 0
        case ["convert", *files]:
            for path in files:
                convert(Path(path))
        case _:
            typer.echo(__doc__)
            return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
