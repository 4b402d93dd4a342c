"""Reading and repair of recordings that are cut off, damaged or invalid."""

from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import Chunk, Metadata

from onboard.errors import UserError
from onboard.observations import DetectionList, VehicleDetection
from onboard.recorder.header import FORMAT, Certificates
from onboard.recorder.inputs import as_input
from onboard.recorder.reader import Entry, RecordedDrive, RecordingError, is_finished, raw_records
from onboard.recorder.repair import repair, write_records
from onboard.replay.replay import compare
from onboard.trace.trace_line import as_json, as_record
from tests.recorder.drive import record_drive
from tests.recorder.headers import HEADER


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    (segment,) = record_drive(tmp_path_factory.mktemp("drive"), flush_every=40).glob("*.mcap")
    return segment


@pytest.fixture(scope="module")
def entries(whole: Path) -> list[Entry]:
    return list(RecordedDrive([whole]).entries())


def cut(whole: Path, folder: Path, size: int) -> Path:
    path = folder / whole.name
    path.write_bytes(whole.read_bytes()[:size])
    return path


def test_a_recording_cut_off_anywhere_is_read_up_to_the_cut(
    whole: Path, entries: list[Entry], tmp_path: Path
) -> None:
    rng = np.random.default_rng(1)
    size = whole.stat().st_size
    header_end = whole.read_bytes().index(b"zstd")
    longest = 0
    for cut_at in sorted(rng.integers(header_end, size, 25).tolist()):
        left = list(RecordedDrive([cut(whole, tmp_path, cut_at)]).entries())
        assert left == entries[: len(left)]
        assert len(left) >= longest
        longest = len(left)
    assert longest > len(entries) // 2


def test_the_replay_of_a_cut_off_recording_equals_it(whole: Path, tmp_path: Path) -> None:
    comparison = compare(RecordedDrive([cut(whole, tmp_path, whole.stat().st_size // 2)]))

    assert comparison.difference is None
    assert comparison.outputs > 10


def test_a_damaged_recording_is_read_up_to_the_damage(
    whole: Path, entries: list[Entry], tmp_path: Path
) -> None:
    rng = np.random.default_rng(2)
    content = bytearray(whole.read_bytes())
    begin = content.index(b"zstd")
    for at in rng.integers(begin, len(content), 25).tolist():
        damaged = bytearray(content)
        damaged[at] ^= 1 << int(rng.integers(8))
        path = tmp_path / "damaged.mcap"
        path.write_bytes(damaged)
        left = list(RecordedDrive([path]).entries())
        assert left == entries[: len(left)]


def test_a_repaired_recording_opens_in_any_mcap_reader_with_all_valid_records(
    whole: Path, tmp_path: Path
) -> None:
    path = cut(whole, tmp_path, whole.stat().st_size * 2 // 3)
    left = list(RecordedDrive([path]).entries())
    (tmp_path / "20250615T150641.000Z-0000.mcap").write_bytes(whole.read_bytes()[:20])

    repair(tmp_path, except_for=tmp_path / "other.mcap")

    assert is_finished(path)
    assert list(RecordedDrive([path]).entries()) == left
    assert list(tmp_path.iterdir()) == [path], "a file cut off before its header is deleted"
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == len(left) == len(list(reader.iter_messages()))


def test_a_link_at_the_place_of_the_repaired_file_leads_nowhere(
    whole: Path, tmp_path: Path
) -> None:
    """Another user may have put it there, to have the file that it names overwritten."""
    path = cut(whole, tmp_path, whole.stat().st_size * 2 // 3)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.write_text("mine")
    path.with_suffix(".repairing").symlink_to(elsewhere)

    repair(tmp_path, except_for=tmp_path / "other.mcap")

    assert is_finished(path)
    assert elsewhere.read_text() == "mine"
    assert sorted(tmp_path.iterdir()) == [path, elsewhere]


def test_every_topic_has_a_schema_that_foxglove_reads(whole: Path) -> None:
    with whole.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert {schema.encoding for schema in summary.schemas.values()} == {"jsonschema"}
    assert {channel.message_encoding for channel in summary.channels.values()} == {"json"}
    by_topic = {c.topic: summary.schemas[c.schema_id].name for c in summary.channels.values()}
    assert by_topic["/in/lead"] == "Lead"
    assert by_topic["/out/perceived_object"] == "PerceivedObject"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "cut off before its header"),
        (b"no mcap at all, but long enough to be one", "no MCAP file"),
        (b"\x89MCAP0\r\n", "cut off before its header"),
    ],
)
def test_a_file_that_is_not_a_recording_is_an_error(
    content: bytes, message: str, tmp_path: Path
) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(content)

    with pytest.raises(RecordingError, match=message):
        RecordedDrive([path])


GIB_8 = 8 * 2**30
FRAME_OF_8_GIB = b"\x28\xb5\x2f\xfd\xc0\x58" + GIB_8.to_bytes(8, "little")
"""Head of a zstd frame (RFC 8878, 3.1.1.1) that announces its content size."""
CHUNK_HEAD_BYTES = 41
"""Of a Chunk record before the name of its compression."""
FRAME_WITHOUT_SIZE = zstandard.ZstdCompressor(write_content_size=False).compress(bytes(1000))


def chunk_of(frame: bytes, announced: int, compression: str = "zstd") -> Chunk:
    return Chunk(
        compression=compression,
        data=frame,
        message_end_time=0,
        message_start_time=0,
        uncompressed_crc=0,
        uncompressed_size=announced,
    )


@pytest.mark.parametrize(
    ("chunk", "message"),
    [
        pytest.param(chunk_of(FRAME_OF_8_GIB, 1000), "8589934592 bytes", id="in its frame"),
        pytest.param(chunk_of(FRAME_WITHOUT_SIZE, GIB_8), "8589934592 bytes", id="in its head"),
        pytest.param(chunk_of(b"", 1000, "lz4"), "compressed by lz4", id="in no place"),
    ],
)
def test_a_chunk_of_gigabytes_is_refused_before_it_takes_memory(
    whole: Path, chunk: Chunk, message: str, tmp_path: Path
) -> None:
    path = tmp_path / "bomb.mcap"
    path.write_bytes(before_chunks(whole) + encoded(chunk))

    with pytest.raises(RecordingError, match=rf"bomb\.mcap: .*{message}"):
        list(RecordedDrive([path]).entries())


@pytest.mark.parametrize("length", [2**60, 2**63])
def test_a_length_that_no_file_has_ends_the_recording(
    whole: Path, length: int, tmp_path: Path
) -> None:
    path = tmp_path / "damaged.mcap"
    content = bytearray(whole.read_bytes())
    at = content.index(b"zstd") + len(b"zstd")
    content[at : at + 8] = length.to_bytes(8, "little")
    path.write_bytes(content)

    assert list(RecordedDrive([path]).entries()) == []


def before_chunks(segment: Path) -> bytes:
    content = segment.read_bytes()
    return content[: content.index(b"zstd") - CHUNK_HEAD_BYTES]


def encoded(chunk: Chunk) -> bytes:
    builder = RecordBuilder()
    chunk.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def test_a_missing_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="No such file"):
        RecordedDrive([tmp_path / "x.mcap"])


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        (
            "format",
            "0",
            f"by onboard .* in format 0; this is onboard .*, which reads formats 1 to {FORMAT}",
        ),
        (
            "format",
            str(FORMAT + 1),
            f"by onboard .* in format {FORMAT + 1}; this is onboard",
        ),
        ("segment", "one", "damaged header"),
        ("head", "{", "damaged header"),
        ("head", "{}", "is required and missing"),
    ],
)
def test_another_format_or_a_damaged_header_is_refused(
    whole: Path, field: str, value: str, message: str, tmp_path: Path
) -> None:
    records = list(raw_records(whole))
    metadata = next(record for record in records if isinstance(record, Metadata))
    metadata.metadata[field] = value
    path = tmp_path / "other.mcap"
    with path.open("wb") as file:
        write_records(records, file)

    with pytest.raises(Exception, match=message):
        RecordedDrive([path])


def test_a_damaged_certificate_in_the_header_is_an_error_that_names_the_drive() -> None:
    damaged = Certificates(pseudonyms=("80 no certificate",), roots=("8003",), authorities=())
    header = HEADER.model_copy(update={"certificates": damaged})
    with pytest.raises(UserError, match=f"the recording of {HEADER.drive}: a certificate"):
        header.credentials()


def test_a_detection_list_is_read_as_it_was_written() -> None:
    detections = DetectionList(
        7.0, tuple(VehicleDetection(7.0, k, 20.0 + k, 1.0, 0.1, 0.01) for k in range(3))
    )
    line = as_json(as_record(detections)).encode()

    assert as_input(Entry("/in/detection_list", 1.75e9, line)) == detections
