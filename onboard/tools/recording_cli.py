"""`onboard export`, and `onboard replay --expect` for recordings of the black box."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, BinaryIO

import typer

from onboard.errors import UserError
from onboard.recorder.reader import RecordedDrive
from onboard.replay.replay import Output, ReplayComparison, compare
from onboard.tools.export import write_candump, write_pcap

RecordingPaths = Annotated[
    list[Path], typer.Argument(help="Segments of one drive, or a folder with only these.")
]


def export(
    recording: RecordingPaths,
    pcap: Annotated[
        Path | None, typer.Option(help="Write the radio's frames here, for Wireshark.")
    ] = None,
    candump: Annotated[
        Path | None, typer.Option(help="Write the CAN frames here, as `candump -l` does.")
    ] = None,
) -> None:
    """Export a recording's radio and CAN frames, for other tools."""
    if pcap is None and candump is None:
        raise UserError("nothing to export: give --pcap or --candump, or both")
    drive = RecordedDrive(recording)
    if pcap is not None:
        with _created(pcap) as file:
            typer.echo(f"{pcap}: {write_pcap(drive, file)} WSMs")
    if candump is not None:
        with _created(candump) as file:
            typer.echo(f"{candump}: {write_candump(drive, file)} frames")


def expect(paths: Sequence[Path], tolerance: float) -> bool:
    """Print how far a replay equals its recording; return whether all outputs are equal."""
    drive = RecordedDrive(paths)
    comparison = compare(drive, tolerance)
    for line in _verdict(comparison):
        typer.echo(line)
    if comparison.difference is not None:
        typer.echo(drive.origin())
    if comparison.gap is not None:
        raise UserError(
            f"{comparison.gap.dropped} records are missing here: the disk was full or too"
            " slow. The rest of the recording cannot be compared"
        )
    return comparison.difference is None


def _verdict(comparison: ReplayComparison) -> Iterator[str]:
    rounded = f", last digits of {comparison.rounded} differ (other processor)"
    yield (
        f"{comparison.outputs} outputs in {comparison.until_s:.3f} s equal the recorded ones"
        f"{rounded if comparison.rounded else ''}"
    )
    if comparison.difference is not None:
        yield f"first difference, {comparison.difference.at_s:.6f} s after the start:"
        yield f"  recorded: {_text(comparison.difference.recorded)}"
        yield f"  replayed: {_text(comparison.difference.replayed)}"


def _text(output: Output | None) -> str:
    return "nothing" if output is None else f"{output.topic} {output.data.decode()}"


def _created(path: Path) -> BinaryIO:
    try:
        return path.open("wb")
    except OSError as error:
        raise UserError(f"{path}: cannot be written: {error.strerror}") from error
