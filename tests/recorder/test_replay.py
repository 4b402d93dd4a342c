"""Replay of a recording: outputs equal exactly, or the first difference is reported."""

import json
import math
import secrets
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from mcap.records import McapRecord, Message, Metadata
from typing_extensions import override

from onboard.brake_request.settings import BrakeRequestSettings
from onboard.errors import UserError
from onboard.lcca.group import WarningGroup
from onboard.messages import bsm
from onboard.recorder.identities import ALIAS_LENGTH, Aliases
from onboard.recorder.reader import Entry, RecordedDrive, RecordingError, raw_records
from onboard.recorder.repair import write_records
from onboard.replay.drive_header import OF_THE_CORES, initial_state_of, make_header
from onboard.replay.replay import OTHER_PROCESSOR, Output, compare, play
from onboard.security import ieee1609dot2
from onboard.security.plate_digest import normalised
from onboard.security.pseudonyms import ENTROPY_BYTES
from onboard.tools.cli import main
from onboard.tools.recording_cli import expect
from onboard.vehicle.config import CarConfig
from onboard.wave_udp import psid, wsmp
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import load_scenario
from tests.recorder.drive import AHEAD, BEHIND, KEY, SIMILAR, record_drive
from tests.recorder.headers import HEADER
from tests.terminal import Terminal

EPOCH_UTC_S = 1_750_000_500.0
"""At which an epoch begins."""


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_drive(tmp_path_factory.mktemp("drive"))


@pytest.fixture(scope="module")
def signed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_drive(tmp_path_factory.mktemp("signed"), signed=True)


def test_the_replay_of_a_drive_with_a_warning_equals_the_recording(drive: Path) -> None:
    comparison = compare(RecordedDrive([drive]))

    kinds = {entry.topic for entry in RecordedDrive([drive]).entries()}
    assert {"/out/transition", "/out/warning", "/out/perceived_object", "/out/wsm"} <= kinds
    assert comparison.difference is None
    assert comparison.outputs > 50
    assert comparison.until_s > 3.9


def test_the_replay_of_a_signed_drive_needs_no_private_keys(signed: Path) -> None:
    """Sent messages are compared without signature; received signatures are verified again."""
    recording = RecordedDrive([signed])

    received = [entry.record for entry in recording.entries() if entry.topic == "/out/received"]
    assert all(record["signer_id"] for record in received)
    assert recording.header.certificates is not None
    assert compare(recording).difference is None


def test_revocation_lists_are_part_of_the_initial_state(signed: Path) -> None:
    header = RecordedDrive([signed]).header
    initial = initial_state_of(header)
    assert initial.credentials is not None
    with_list = replace(initial, credentials=replace(initial.credentials, crls=(b"list",)))

    again = make_header(with_list, Aliases(in_clear=False), is_complete=True).credentials()

    assert again is not None
    assert again.crls == (b"list",)


class BeforeTheChange(RecordedDrive):
    """A recording in progress: nothing of the change of the pseudonym is written yet."""

    @override
    def entries(self) -> Iterator[Entry]:
        return (each for each in super().entries() if each.topic != "/in/entropy_input")


@pytest.mark.long
def test_a_drive_that_changes_its_seed_with_its_pseudonym_is_replayed(tmp_path: Path) -> None:
    seeds = iter((b"a seed of 16 oct",))
    recording = RecordedDrive(
        [record_drive(tmp_path, start_utc_s=EPOCH_UTC_S - 2.0, fresh_entropy=lambda: next(seeds))]
    )

    used = [each.record for each in recording.entries() if each.topic == "/in/entropy_input"]
    comparison = compare(recording)

    assert [bytes.fromhex(each["entropy"]) for each in used] == [b"a seed of 16 oct"]
    assert comparison.difference is None
    assert comparison.until_s > 3.9


def test_a_recording_in_progress_does_not_give_away_the_next_pseudonym(tmp_path: Path) -> None:
    """The seed in its header gave the temporary IDs of the whole drive."""
    path = record_drive(
        tmp_path,
        start_utc_s=EPOCH_UTC_S - 2.0,
        fresh_entropy=lambda: secrets.token_bytes(ENTROPY_BYTES),
    )
    sent = {True: set[bytes](), False: set[bytes]()}
    predicted: set[bytes] = set()
    for step in play(BeforeTheChange([path])):
        after = step.at_s >= 2.0
        sent[after] |= temporary_ids(step.recorded)
        predicted |= temporary_ids(step.replayed) if after else set()

    assert len(sent[False]) == len(sent[True]) == len(predicted) == 1
    assert predicted.isdisjoint(sent[True])


def temporary_ids(outputs: list[Output]) -> set[bytes]:
    """Return those in the BSMs among them."""
    frames = [
        wsmp.decode(bytes.fromhex(json.loads(each.data)["data"]))
        for each in outputs
        if each.topic == "/out/wsm"
    ]
    payloads = [
        ieee1609dot2.decode(each.payload).payload for each in frames if each.psid == psid.BSM
    ]
    return {bsm.decode(each).core.temporary_id for each in payloads}


class DerivedMeanwhile(RecordedDrive):
    """A thread derives an ID while each step is at work."""

    @override
    def entries(self) -> Iterator[Entry]:
        identity = next(each for each in super().entries() if each.topic == "/in/identity")
        for entry in super().entries():
            yield entry
            if entry.topic == "/in/step":
                yield identity


def test_an_id_that_a_thread_derives_during_a_step_does_not_hide_its_outputs(drive: Path) -> None:
    comparison = compare(DerivedMeanwhile([drive]))
    assert comparison.difference is None
    assert comparison.outputs == compare(RecordedDrive([drive])).outputs


@pytest.mark.long
def test_a_change_of_communication_ids_is_replayed(tmp_path: Path) -> None:
    recording = RecordedDrive([record_drive(tmp_path, duration_s=22.0)])

    epochs = {e.record["epoch"] for e in recording.entries() if e.topic == "/in/identity"}
    assert len(epochs) == 2
    assert compare(recording).difference is None


@pytest.mark.long
@pytest.mark.parametrize("name", ["stopped-ecu", "frozen-camera", "clock-set-wrong"])
def test_the_replay_of_a_drive_with_faults_equals_the_recording(name: str, tmp_path: Path) -> None:
    scenario = load_scenario(name).model_copy(update={"duration_s": 16.0})
    run_virtual(scenario, recordings_folder=tmp_path)

    for car in scenario.equipped:
        assert compare(RecordedDrive([tmp_path / car])).difference is None


def test_the_first_different_output_of_changed_cores_is_reported(
    drive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    receive = WarningGroup.receive_lead
    joined_at = next(
        entry.record["stamp_s"]
        for entry in RecordedDrive([drive]).entries()
        if entry.topic == "/out/sent" and entry.record["message"] == "join"
    )

    def ignore_lead(group: WarningGroup, ahead: object, now: float, **more: bool) -> None:
        receive(group, None, now)

    monkeypatch.setattr(WarningGroup, "receive_lead", ignore_lead)
    difference = compare(RecordedDrive([drive])).difference

    assert difference is not None
    assert difference.at_s == pytest.approx(joined_at - RecordedDrive([drive]).header.now_s)
    assert difference.recorded is not None
    assert json.loads(difference.recorded.data)["stamp_s"] == joined_at


def tampered(drive: Path, folder: Path, old: bytes, new: bytes) -> Path:
    """Write a copy with `old` replaced in the first record that contains it."""
    (segment,) = drive.glob("*.mcap")
    records = list(raw_records(segment))
    found = next(r for r in records if isinstance(r, Message) and old in r.data)
    found.data = found.data.replace(old, new, 1)
    return write_copy(records, folder / segment.name)


def write_copy(records: list[McapRecord], path: Path) -> Path:
    path.parent.mkdir(exist_ok=True)
    with path.open("wb") as file:
        write_records(records, file)
    return path


def test_a_changed_last_digit_is_reported_and_no_difference_of_decisions(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    objects = [
        e.record for e in RecordedDrive([drive]).entries() if e.topic == "/out/perceived_object"
    ]
    recorded = next(record["state"][0] for record in objects if record["state"][0] != 0.0)
    other = math.nextafter(recorded, math.inf)
    recording = RecordedDrive(
        [tampered(drive, tmp_path, repr(recorded).encode(), repr(other).encode())]
    )

    difference = compare(recording, tolerance=0.0).difference

    assert difference is not None
    assert difference.recorded is not None
    assert difference.replayed is not None
    assert repr(other).encode() in difference.recorded.data
    assert repr(recorded).encode() in difference.replayed.data
    allowed = compare(recording)
    assert allowed.difference is None, "another processor may round the last digit"
    assert allowed.rounded == 1
    assert compare(RecordedDrive([drive])).rounded == 0
    assert expect([tmp_path], OTHER_PROCESSOR)
    assert "equal the recorded ones, last digits of 1 differ (other processor)" in (
        capsys.readouterr().out
    )


def test_a_changed_signed_message_is_a_difference(signed: Path, tmp_path: Path) -> None:
    sent = next(
        e.record["data"] for e in RecordedDrive([signed]).entries() if e.topic == "/out/wsm"
    )
    other = sent[:60] + f"{int(sent[60], 16) ^ 1:x}" + sent[61:]
    recording = RecordedDrive(
        [tampered(signed, tmp_path / "forged", sent.encode(), other.encode())]
    )

    difference = compare(recording).difference

    assert difference is not None
    assert difference.recorded is not None
    assert difference.recorded.topic == "/out/wsm"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b'"speed_m_s":15.0', b'"speed_m_s":"fast"', "invalid input"),
        (b'"resolution_m_s"', b'"resolution"', "invalid input"),
        (b'"identity":"known"', b'"identity":"friend"', "invalid input"),
    ],
)
def test_an_invalid_input_is_an_error_of_the_recording(
    drive: Path, tmp_path: Path, old: bytes, new: bytes, message: str
) -> None:
    with pytest.raises(UserError, match=message):
        compare(RecordedDrive([tampered(drive, tmp_path, old, new)]))


def test_play_yields_the_events_of_the_drive(drive: Path) -> None:
    kinds = {event.kind for step in play(RecordedDrive([drive])) for event in step.events}

    assert {"speed", "lead", "transition", "warning"} <= kinds


# ---- several segments ---------------------------------------------------------------------


@pytest.mark.long
def test_all_segments_of_a_drive_are_replayed_as_one(tmp_path: Path) -> None:
    recording = RecordedDrive([record_drive(tmp_path, segment_s=1.0)])

    assert len(recording.files) == 4
    assert compare(recording).difference is None


def test_a_drive_with_missing_segments_is_not_compared(tmp_path: Path) -> None:
    segments = sorted(record_drive(tmp_path, segment_s=1.0).glob("*.mcap"))

    with pytest.raises(RecordingError, match="starts within its drive"):
        compare(RecordedDrive(segments[1:]))
    with pytest.raises(RecordingError, match="segments are missing: 2"):
        compare(RecordedDrive([segments[0], segments[1], segments[3]]))
    assert list(play(RecordedDrive(segments[1:])))


def test_segments_of_two_drives_are_refused(drive: Path, tmp_path: Path) -> None:
    records = list(raw_records(next(drive.glob("*.mcap"))))
    metadata = next(record for record in records if isinstance(record, Metadata))
    metadata.metadata["head"] = metadata.metadata["head"].replace('"drive":"2025', '"drive":"2026')
    other = write_copy(records, tmp_path / "other.mcap")

    with pytest.raises(RecordingError, match="several drives") as error:
        RecordedDrive([drive, other])

    assert f"{tmp_path}/2026" in str(error.value)
    assert str(error.value).endswith("-*.mcap (1)")
    assert f"-*.mcap ({len(list(drive.glob('*.mcap')))})" in str(error.value)


# ---- privacy -------------------------------------------------------------------------------


def contents_of(folder: Path) -> bytes:
    recording = RecordedDrive([folder])
    header = recording.header.model_dump_json().encode()
    return header + b"\n".join(entry.topic.encode() + entry.data for entry in recording.entries())


def test_by_default_a_recording_holds_no_plate_and_no_key(drive: Path) -> None:
    content = contents_of(drive)

    for secret in (AHEAD, BEHIND, *SIMILAR, *map(normalised, SIMILAR), KEY):
        assert secret.encode() not in content
        assert secret.encode().hex().encode() not in content


def test_every_candidate_of_a_lead_has_an_alias(drive: Path) -> None:
    leads = [e.record for e in RecordedDrive([drive]).entries() if e.topic == "/in/lead"]

    last = leads[-1]["candidates"]
    aliases = [each["text"] for each in last]
    assert len(set(aliases)) == 1 + len(SIMILAR)
    assert aliases[0] == leads[-1]["text"]
    assert all(len(alias) == ALIAS_LENGTH for alias in aliases)
    assert [each["probability"] for each in last] == sorted(
        (each["probability"] for each in last), reverse=True
    )


def test_every_section_of_a_configuration_is_either_recorded_or_excluded() -> None:
    """A new section belongs into `OF_THE_CORES`, or into the exclusions below."""
    not_recorded = {
        "seed",
        "can",
        "camera",
        "detector",
        "gnss",
        "radio",
        "hmi",
        "interface",
        "trace",
        "recorder",
    }

    assert set(CarConfig.model_fields) == OF_THE_CORES | not_recorded
    assert not OF_THE_CORES & not_recorded


@pytest.mark.long
def test_requests_to_brake_are_replayed_without_their_addresses(tmp_path: Path) -> None:
    run_virtual(load_scenario("requested-braking"), recordings_folder=tmp_path)
    drive = RecordedDrive([tmp_path / "ann"])

    comparison = compare(drive)
    requested = [entry for entry in drive.entries() if entry.topic == "/out/brake_request"]
    assert comparison.difference is None
    assert len(requested) > 20

    initial = initial_state_of(drive.header)
    can = {"channel": "can1", "dbc": "x.dbc", "deceleration": "A.B"}
    request = BrakeRequestSettings.model_validate({"can": can, "most_m_s2": 4.0}, strict=False)
    config = initial.config.model_copy(update={"brake_request": request})
    again = make_header(replace(initial, config=config), Aliases(in_clear=False), is_complete=True)
    assert initial_state_of(again).config.brake_request == BrakeRequestSettings(most_m_s2=4.0)


def test_a_plate_has_a_different_alias_in_every_drive(drive: Path, tmp_path: Path) -> None:
    first, second = (
        {e.record["text"] for e in RecordedDrive([folder]).entries() if e.topic == "/in/plate"}
        for folder in (drive, record_drive(tmp_path))
    )

    assert len(first) == len(second) == 1
    assert first != second


def test_plates_are_recorded_in_clear_if_configured(tmp_path: Path) -> None:
    folder = record_drive(tmp_path, plates="clear")

    assert AHEAD.encode() in contents_of(folder)
    assert compare(RecordedDrive([folder])).difference is None


def test_a_recording_without_positions_holds_none_and_is_not_compared(tmp_path: Path) -> None:
    recording = RecordedDrive([record_drive(tmp_path, positions=False)])

    topics = {entry.topic for entry in recording.entries()}
    assert "/in/lead" in topics
    assert not topics & {"/in/position", "/out/perceived_object"}
    assert all(
        '"message":"bsm"' not in entry.data.decode() and b"0320" not in entry.data[:60]
        for entry in recording.entries()
    )
    with pytest.raises(RecordingError, match="without positions"):
        compare(recording)


def test_only_the_owner_can_read_a_recording(drive: Path) -> None:
    assert {path.stat().st_mode & 0o777 for path in drive.glob("*.mcap")} == {0o600}


# ---- the command --------------------------------------------------------------------------


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Terminal:
    return Terminal("onboard", main, monkeypatch, capsys)


@pytest.mark.long
def test_expect_prints_the_comparison_and_exits_with_0_or_1(
    terminal: Terminal, drive: Path, tmp_path: Path
) -> None:
    good = terminal.run("replay", drive, "--expect")
    changed = tampered(drive, tmp_path, b'"kind":"warning"', b'"kind":"wArning"')
    bad = terminal.run("replay", changed, "--expect")

    assert (good.returncode, bad.returncode) == (0, 1)
    assert "equal the recorded ones" in good.stdout
    assert "first difference, 3." in bad.stdout
    assert "recorded: /out/warning" in bad.stdout
    assert "replayed: /out/warning" in bad.stdout


def test_replay_prints_the_events_of_a_recording(terminal: Terminal, drive: Path) -> None:
    result = terminal.run("replay", drive)

    assert result.returncode == 0
    assert '"kind":"warning"' in result.stdout


def test_an_empty_folder_is_an_error_of_one_line(terminal: Terminal, tmp_path: Path) -> None:
    result = terminal.run("replay", tmp_path, "--expect")

    assert result.returncode == 2
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith(f"{tmp_path}: no recording found")


def test_a_folder_of_folders_names_those_with_recordings(drive: Path, tmp_path: Path) -> None:
    shutil.copytree(drive, tmp_path / "car1")
    with pytest.raises(RecordingError, match=f"there are some in {tmp_path / 'car1'}"):
        RecordedDrive([tmp_path])


def test_the_dbc_file_of_a_recording_is_read_from_its_header() -> None:
    dbc = 'VERSION ""\nBU_: CAR\nBO_ 256 PEDALS: 1 CAR\n SG_ BRAKE : 0|1@1+ (1,0) [0|1] "" CAR\n'
    broadcast = {"dbc": "gone.dbc", "brake_pedal": "PEDALS.BRAKE"}
    config = {"car": {"plate": "A1"}, "obd": {"broadcast": broadcast}}

    state = initial_state_of(HEADER.model_copy(update={"config": config, "dbc": dbc}))

    assert state.signals is not None
    assert state.signals.dbc_text == dbc
