"""A recording, replayed: the same decisions to the bit, or the first that differs by name."""

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest
from mcap.records import McapRecord, Message, Metadata

from onboard.config import CarConfig
from onboard.errors import UserError
from onboard.lcca.group import WarningGroup
from onboard.recorder.reader import RecordedDrive, RecordingError, raw_records
from onboard.recorder.repair import write_records
from onboard.replay.drive_header import OF_THE_CORES, initial_state_of
from onboard.replay.replay import compare, play
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import load_scenario
from tests.recorder.drive import AHEAD, BEHIND, KEY, record_drive
from tests.recorder.headers import HEAD


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_drive(tmp_path_factory.mktemp("drive"))


def test_a_drive_with_a_warning_in_it_is_decided_again(drive: Path) -> None:
    comparison = compare(RecordedDrive([drive]))

    kinds = {entry.topic for entry in RecordedDrive([drive]).entries()}
    assert {"/out/transition", "/out/warning", "/out/perceived_object", "/out/wsm"} <= kinds
    assert comparison.difference is None
    assert comparison.outputs > 50
    assert comparison.until_s > 3.9


def test_a_signed_drive_is_decided_again_without_the_keys(tmp_path: Path) -> None:
    """All of a sent message but its signature is compared; what came in is verified anew."""
    box = RecordedDrive([record_drive(tmp_path, signed=True)])

    said = [entry.record for entry in box.entries() if entry.topic == "/out/received"]
    assert all(record["signer_id"] for record in said)
    assert box.head.certificates is not None
    assert compare(box).difference is None


def test_the_change_of_everybodys_id_is_replayed_as_well(tmp_path: Path) -> None:
    box = RecordedDrive([record_drive(tmp_path, duration_s=22.0)])

    epochs = {e.record["epoch"] for e in box.entries() if e.topic == "/in/identity"}
    assert len(epochs) == 2
    assert compare(box).difference is None


@pytest.mark.parametrize("name", ["stopped-ecu", "frozen-camera"])
def test_drives_with_faults_are_decided_again(name: str, tmp_path: Path) -> None:
    scenario = load_scenario(name).model_copy(update={"duration_s": 16.0})
    run_virtual(scenario, box_folder=tmp_path)

    for car in scenario.equipped:
        assert compare(RecordedDrive([tmp_path / car])).difference is None


def test_cores_that_decide_otherwise_are_found_at_their_first_decision(
    drive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ask = WarningGroup.receive_preceding_vehicle
    joined_at = next(
        entry.record["stamp_s"]
        for entry in RecordedDrive([drive]).entries()
        if entry.topic == "/out/sent" and entry.record["message"] == "join"
    )

    def look_away(group: WarningGroup, ahead: object, now: float) -> None:
        ask(group, None, now)

    monkeypatch.setattr(WarningGroup, "receive_preceding_vehicle", look_away)
    difference = compare(RecordedDrive([drive])).difference

    assert difference is not None
    assert difference.at_s == pytest.approx(joined_at - RecordedDrive([drive]).head.now_s)
    assert difference.recorded is not None
    assert json.loads(difference.recorded.data)["stamp_s"] == joined_at


def tampered(drive: Path, folder: Path, old: bytes, new: bytes) -> Path:
    """The recording with the first message that holds `old` changed."""
    (segment,) = drive.glob("*.mcap")
    records = list(raw_records(segment))
    found = next(r for r in records if isinstance(r, Message) and old in r.data)
    found.data = found.data.replace(old, new, 1)
    return written(records, folder / segment.name)


def written(records: list[McapRecord], path: Path) -> Path:
    path.parent.mkdir(exist_ok=True)
    with path.open("wb") as file:
        write_records(records, file)
    return path


def test_one_bit_of_one_number_is_a_difference(drive: Path, tmp_path: Path) -> None:
    told = [
        e.record for e in RecordedDrive([drive]).entries() if e.topic == "/out/perceived_object"
    ]
    recorded = next(record["state"][0] for record in told if record["state"][0] != 0.0)
    other = math.nextafter(recorded, math.inf)
    box = RecordedDrive([tampered(drive, tmp_path, repr(recorded).encode(), repr(other).encode())])

    difference = compare(box).difference

    assert difference is not None
    assert difference.recorded is not None
    assert difference.replayed is not None
    assert repr(other).encode() in difference.recorded.data
    assert repr(recorded).encode() in difference.replayed.data
    assert compare(box, tolerance=1e-9).difference is None, "unless it was another processor's"


def test_a_forged_signed_message_differs_in_more_than_its_signature(tmp_path: Path) -> None:
    signed = record_drive(tmp_path / "signed", signed=True)
    sent = next(
        e.record["data"] for e in RecordedDrive([signed]).entries() if e.topic == "/out/wsm"
    )
    other = sent[:60] + f"{int(sent[60], 16) ^ 1:x}" + sent[61:]
    box = RecordedDrive([tampered(signed, tmp_path / "forged", sent.encode(), other.encode())])

    difference = compare(box).difference

    assert difference is not None
    assert difference.recorded is not None
    assert difference.recorded.topic == "/out/wsm"


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (b'"speed_m_s":15.0', b'"speed_m_s":"fast"', "cannot be"),
        (b'"resolution_m_s"', b'"resolution"', "cannot be"),
        (b'"identity":"known"', b'"identity":"friend"', "cannot be"),
    ],
)
def test_an_input_that_cannot_be_is_the_recordings_fault(
    drive: Path, tmp_path: Path, old: bytes, new: bytes, told: str
) -> None:
    with pytest.raises(UserError, match=told):
        compare(RecordedDrive([tampered(drive, tmp_path, old, new)]))


def test_without_expectation_the_events_come_as_from_any_replay(drive: Path) -> None:
    kinds = {event.kind for moment in play(RecordedDrive([drive])) for event in moment.events}

    assert {"speed", "lead", "transition", "warning"} <= kinds


# ---- several segments ---------------------------------------------------------------------


def test_segments_of_one_drive_are_one_drive(tmp_path: Path) -> None:
    box = RecordedDrive([record_drive(tmp_path, segment_s=1.0)])

    assert len(box.files) == 4
    assert compare(box).difference is None


def test_a_drive_whose_beginning_is_gone_proves_nothing(tmp_path: Path) -> None:
    segments = sorted(record_drive(tmp_path, segment_s=1.0).glob("*.mcap"))

    with pytest.raises(RecordingError, match="starts within its drive"):
        compare(RecordedDrive(segments[1:]))
    with pytest.raises(RecordingError, match="segments are missing: 2"):
        compare(RecordedDrive([segments[0], segments[1], segments[3]]))
    assert list(play(RecordedDrive(segments[1:])))


def test_segments_of_two_drives_are_not_mixed(drive: Path, tmp_path: Path) -> None:
    records = list(raw_records(next(drive.glob("*.mcap"))))
    metadata = next(record for record in records if isinstance(record, Metadata))
    metadata.metadata["head"] = metadata.metadata["head"].replace('"drive":"2025', '"drive":"2026')
    other = written(records, tmp_path / "other.mcap")

    with pytest.raises(RecordingError, match="several drives"):
        RecordedDrive([drive, other])


# ---- what is not recorded -----------------------------------------------------------------


def everything_in(folder: Path) -> bytes:
    box = RecordedDrive([folder])
    head = box.head.model_dump_json().encode()
    return head + b"\n".join(entry.topic.encode() + entry.data for entry in box.entries())


def test_by_default_no_plate_and_no_key_is_in_a_recording(drive: Path) -> None:
    content = everything_in(drive)

    for secret in (AHEAD, BEHIND, KEY):
        assert secret.encode() not in content
        assert secret.encode().hex().encode() not in content


def test_of_every_section_of_a_configuration_it_is_decided_whether_it_is_recorded() -> None:
    """A new one goes into `OF_THE_CORES`, or here: it is a wire, a file, or written otherwise."""
    not_recorded = {
        "seed",
        "can",
        "camera",
        "detector",
        "gnss",
        "radio",
        "hmi",
        "trace",
        "recorder",
    }

    assert set(CarConfig.model_fields) == OF_THE_CORES | not_recorded
    assert not OF_THE_CORES & not_recorded


def test_a_plate_has_another_word_in_every_drive(drive: Path, tmp_path: Path) -> None:
    first, second = (
        {e.record["text"] for e in RecordedDrive([folder]).entries() if e.topic == "/in/plate"}
        for folder in (drive, record_drive(tmp_path))
    )

    assert len(first) == len(second) == 1
    assert first != second


def test_plates_in_clear_if_asked_for(tmp_path: Path) -> None:
    folder = record_drive(tmp_path, plates="clear")

    assert AHEAD.encode() in everything_in(folder)
    assert compare(RecordedDrive([folder])).difference is None


def test_without_positions_nobody_can_be_placed_and_nothing_is_proved(tmp_path: Path) -> None:
    box = RecordedDrive([record_drive(tmp_path, positions=False)])

    topics = {entry.topic for entry in box.entries()}
    assert "/in/lead" in topics
    assert not topics & {"/in/position", "/out/perceived_object"}
    assert all(
        '"message":"bsm"' not in entry.data.decode() and b"0320" not in entry.data[:60]
        for entry in box.entries()
    )
    with pytest.raises(RecordingError, match="without positions"):
        compare(box)


def test_only_the_owner_can_open_a_recording(drive: Path) -> None:
    assert {path.stat().st_mode & 0o777 for path in drive.glob("*.mcap")} == {0o600}


# ---- the command --------------------------------------------------------------------------


def onboard(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "onboard", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_expect_says_so_and_exits_with_0_or_1(drive: Path, tmp_path: Path) -> None:
    good = onboard("replay", drive, "--expect")
    changed = tampered(drive, tmp_path, b'"kind":"warning"', b'"kind":"wArning"')
    bad = onboard("replay", changed, "--expect")

    assert (good.returncode, bad.returncode) == (0, 1)
    assert "equal the recorded ones" in good.stdout
    assert "the first that differs, 3." in bad.stdout
    assert "recorded: /out/warning" in bad.stdout
    assert "replayed: /out/warning" in bad.stdout


def test_replay_prints_the_events_of_a_recording(drive: Path) -> None:
    result = onboard("replay", drive)

    assert result.returncode == 0
    assert '"kind":"warning"' in result.stdout


def test_what_cannot_be_replayed_is_one_line(tmp_path: Path) -> None:
    result = onboard("replay", tmp_path, "--expect")

    assert result.returncode == 2
    assert result.stderr.count("\n") == 1
    assert "no recording there" in result.stderr


def test_the_dbc_file_of_a_recording_is_read_from_its_header() -> None:
    dbc = 'VERSION ""\nBU_: CAR\nBO_ 256 PEDALS: 1 CAR\n SG_ BRAKE : 0|1@1+ (1,0) [0|1] "" CAR\n'
    broadcast = {"dbc": "gone.dbc", "brake_pedal": "PEDALS.BRAKE"}
    config = {"car": {"plate": "A1"}, "obd": {"broadcast": broadcast}}

    state = initial_state_of(HEAD.model_copy(update={"config": config, "dbc": dbc}))

    assert state.signals is not None
    assert state.signals.dbc_text == dbc
