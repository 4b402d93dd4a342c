"""`onboard decode`: every layer with its fields, or the reason why it cannot be decoded."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner, Result

from onboard.errors import UserError
from onboard.messages import bsm, lcca, map_data, mvs_footer, sdsm, spat
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.lcca import Leave, LeaveReason
from onboard.messages.mvs_footer import MvsFooter
from onboard.security import ieee1609dot2
from onboard.tools.decode.cli import decode
from onboard.tools.decode.describe import Form, describe
from onboard.wave_udp import immediate_forward, psid, wsmp
from onboard.wave_udp.capture import PcapWriter
from onboard.wave_udp.immediate_forward import ImmediateForward
from onboard.wave_udp.wsmp import Element, WaveShortMessage
from tests.messages.crossing_messages import crossing_map, crossing_spat
from tests.messages.test_sdsm import MESSAGE

LEAVE = Leave(b"sender__", b"leader__", 3, b"to______", LeaveReason.GAP)
LEAVE_FIELDS = {
    "message": "leave",
    "sender_id": b"sender__".hex(),
    "leader_id": b"leader__".hex(),
    "number": 3,
    "to_id": b"to______".hex(),
    "reason": "gap",
}


def unsecured(payload: bytes) -> bytes:
    return ieee1609dot2.encode_unsecured(payload)


WSM = wsmp.encode(
    WaveShortMessage(
        0x4020, unsecured(lcca.encode(LEAVE)), 172, 6.0, 20, n_extensions=(Element(99, b"\xab"),)
    )
)
WSM_FIELDS = {
    "version": 3,
    "channel_number": 172,
    "data_rate_mbit_s": 6.0,
    "transmit_power_dbm": 20,
    "n_extensions": [{"element_id": 99, "content": "ab"}],
    "psid": 0x4020,
    "psid_name": "private (unregistered) use",
    "t_extensions": [],
    "wsm_length_bytes": 33,
}


def test_a_wsm_is_described_layer_by_layer() -> None:
    layers = describe(WSM)
    assert list(layers) == ["wsm", "1609.2", "lcca"]
    assert layers["wsm"] == WSM_FIELDS
    assert layers["lcca"] == LEAVE_FIELDS


def test_each_layer_is_recognised_by_its_bytes() -> None:
    message = lcca.encode(LEAVE)
    assert describe(message) == {"lcca": LEAVE_FIELDS}
    assert list(describe(unsecured(message))) == ["1609.2", "lcca"]


def test_wsmp_is_recognised_beside_lcca_messages() -> None:
    layers = describe(wsmp.encode(WaveShortMessage(0x4020, unsecured(lcca.encode(LEAVE)))))
    assert list(layers) == ["wsm", "1609.2", "lcca"]
    assert layers["wsm"]["version"] == wsmp.VERSION


def test_the_siblings_of_a_proof_are_shown() -> None:
    layers = describe(lcca.encode(LEAVE, (bytes(12), b"sibling 2...")))
    assert layers["lcca"]["proof"] == ["00" * 12, b"sibling 2...".hex()]


def test_a_repeated_layer_is_described_twice() -> None:
    """A unit wraps data that was wrapped before."""
    layers = describe(unsecured(unsecured(lcca.encode(LEAVE))))
    assert list(layers) == ["1609.2", "1609.2 2", "lcca"]


def test_an_immediate_forward_message_is_described_with_its_payload() -> None:
    text = immediate_forward.encode(
        ImmediateForward("OTHER", 0x4020, 7, unsecured(lcca.encode(LEAVE)))
    )
    layers = describe(text)
    assert list(layers) == ["rsu41", "1609.2", "lcca"]
    assert layers["rsu41"]["psid"] == 0x4020
    assert layers["rsu41"]["priority"] == 7


@pytest.mark.parametrize(
    ("service", "frame", "message_id", "name"),
    [
        (psid.MAP, map_data.encode(crossing_map()), 18, "map_data"),
        (psid.SPAT, spat.encode(crossing_spat()), 19, "spat"),
    ],
)
def test_messages_of_a_road_side_unit_are_described(
    service: int, frame: bytes, message_id: int, name: str
) -> None:
    layers = describe(wsmp.encode(WaveShortMessage(service, unsecured(frame))))
    assert list(layers) == ["wsm", "1609.2", "messageframe"]
    assert layers["wsm"]["psid_name"].startswith("intersection ")
    assert layers["messageframe"]["message_id"] == message_id
    (intersection,) = layers["messageframe"][name]["intersections"]
    assert intersection["id"] == {"region": 7, "id": 501}
    json.dumps(layers)


def test_what_a_sensor_data_sharing_message_detects_is_described() -> None:
    frame = unsecured(sdsm.encode(MESSAGE))
    layers = describe(wsmp.encode(WaveShortMessage(psid.SENSOR_SHARING, frame)))
    assert layers["wsm"]["psid_name"] == "sensor sharing service"
    (detected,) = layers["messageframe"]["sensor_data_sharing_message"]["objects"]
    assert detected["common"]["offset"] == {"east_m": -12.3, "north_m": 45.6, "up_m": 0.7}
    json.dumps(layers)


FOOTER = mvs_footer.encode(MvsFooter(1_790_000_000_000, 25.0, 121.5, (b"abcd",), (), ()))


def test_the_footer_of_a_bsm_is_a_layer_of_its_own() -> None:
    core = CoreData(msg_cnt=5, temporary_id=b"abcd")
    layers = describe(bsm.encode(BasicSafetyMessage(core, footer=FOOTER)))
    assert list(layers) == ["messageframe", "mvs_footer"]
    assert layers["mvs_footer"]["observers"] == [b"abcd".hex()]


def test_a_bsm_with_an_invalid_footer_is_described() -> None:
    core = CoreData(msg_cnt=5, temporary_id=b"abcd")
    layers = describe(bsm.encode(BasicSafetyMessage(core, footer=FOOTER[:-1])))
    assert list(layers) == ["messageframe", "error", "undecoded"]
    assert layers["messageframe"]["basic_safety_message"]["core"]["msg_cnt"] == 5
    assert (layers["error"]["layer"], layers["error"]["reason"]) == ("mvs_footer", "too_short")
    assert layers["undecoded"] == FOOTER[:-1].hex()


@pytest.mark.parametrize(
    ("data", "form", "decoded", "layer_and_reason", "undecoded"),
    [
        ("", Form.AUTO, [], ("messageframe", "too_short"), ""),
        ("ff", Form.AUTO, [], ("wsm", "unknown_version"), "ff"),
        ("0300", Form.AUTO, [], ("wsm", "too_short"), "0300"),
        (
            "030020 05 0380020014",
            Form.AUTO,
            ["wsm", "1609.2"],
            ("messageframe", "too_short"),
            "0014",
        ),
        ("030020 02 0380", Form.AUTO, ["wsm"], ("1609.2", "malformed"), "0380"),
        ("0280 01 aa", Form.LCCA, [], ("lcca", "unknown_version"), "028001aa"),
        ("01 030023 0101", Form.AUTO, [], ("wsm", "unknown_version"), "010300230101"),
        ("030023 02 0102", Form.AUTO, ["wsm"], ("auto", "unknown_psid"), "0102"),
        ("030023 01 ff", Form.AUTO, ["wsm"], ("auto", "unknown_psid"), "ff"),
        ("0014", Form.WSM, [], ("wsm", "unknown_version"), "0014"),
        ("00130100", Form.AUTO, [], ("messageframe", "too_short"), "00130100"),
        ("001f0100", Form.AUTO, [], ("messageframe", "unknown_message"), "001f0100"),
    ],
)
def test_an_error_names_layer_and_reason(
    data: str, form: Form, decoded: list[str], layer_and_reason: tuple[str, str], undecoded: str
) -> None:
    layers = describe(bytes.fromhex(data), form)
    assert list(layers) == [*decoded, "error", "undecoded"]
    assert (layers["error"]["layer"], layers["error"]["reason"]) == layer_and_reason
    assert layers["undecoded"] == undecoded


def run(*arguments: Path) -> Result:
    app = typer.Typer()
    app.command()(decode)
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def records(result: Result) -> list[dict[str, Any]]:
    assert result.exception is None, result.exception
    return [json.loads(line) for line in result.output.splitlines()]


def test_hex_lines_give_one_object_or_error_a_line(tmp_path: Path) -> None:
    file = tmp_path / "frames.hex"
    file.write_text(f"# recorded\n{WSM.hex()}\n\n0x{WSM.hex(':')}  # the same\nhello\n")
    first, second, third = records(run(file))
    assert first == {"line": 2, **describe(WSM)}
    assert second == {"line": 4, **describe(WSM)}
    assert (third["line"], third["error"]["reason"]) == (5, "not_hex")


@pytest.fixture
def decoded_from_stdin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., list[dict[str, dict[str, int | str] | int]]]:
    def decoded(data: bytes, form: Form) -> list[dict[str, dict[str, int | str] | int]]:
        file = tmp_path / "stdin"
        file.write_bytes(data)
        with file.open() as stdin:
            monkeypatch.setattr(sys, "stdin", stdin)
            decode(Path("-"), form)
        return [json.loads(line) for line in capsys.readouterr().out.splitlines()]

    return decoded


def test_the_standard_input_with_a_given_form(
    decoded_from_stdin: Callable[..., list[dict[str, dict[str, int | str] | int]]],
) -> None:
    (layers,) = decoded_from_stdin(lcca.encode(LEAVE).hex().encode(), Form.LCCA)
    assert layers == {"line": 1, "lcca": LEAVE_FIELDS}


def test_a_capture_gives_one_object_a_packet(
    tmp_path: Path, decoded_from_stdin: Callable[..., list[dict[str, dict[str, int | str] | int]]]
) -> None:
    file = tmp_path / "radio.pcap"
    with file.open("wb") as stream:
        writer = PcapWriter(stream)
        writer.write(WSM, 1_700_000_000.5, bytes(6))
        writer.write(b"\xff", 1_700_000_001.0, bytes(6))
    good, bad = records(run(file))
    assert good == {"packet": 1, "utc_s": 1_700_000_000.5, **describe(WSM)}
    assert (bad["packet"], bad["error"]["reason"]) == (2, "unknown_version")
    assert decoded_from_stdin(file.read_bytes(), Form.AUTO) == [good, bad]


@pytest.mark.parametrize(
    ("content", "message"),
    [(None, "cannot be read: No such file"), (b"\xd4\xc3\xb2\xa1", "ends within a packet")],
)
def test_an_unreadable_file_is_a_user_error(
    tmp_path: Path, content: bytes | None, message: str
) -> None:
    file = tmp_path / "radio.pcap"
    if content is not None:
        file.write_bytes(content)
    result = run(file)
    assert isinstance(result.exception, UserError)
    assert message in str(result.exception)
    assert str(file) in str(result.exception)


@pytest.mark.parametrize(
    "content", [b"hello\nworld\n", b"\x89PNG\r\n\x1a\n\0\0", b"car: {plate: A1}\n"]
)
def test_a_file_that_is_no_capture_ends_with_1_and_one_line(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "picture.png"
    file.write_bytes(content)
    result = run(file)
    assert result.exit_code == 1
    assert result.output == f"{file}: neither pcap nor pcapng nor lines of hex\n"


@pytest.mark.parametrize("content", [b"", b"# nothing recorded\n\n"])
def test_a_file_without_messages_is_no_error(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "frames.hex"
    file.write_bytes(content)
    result = run(file)
    assert (result.exit_code, result.stdout) == (0, "")
    assert result.stderr == f"{file}: no messages\n"


@pytest.mark.realdata
def test_80_real_message_frames_are_described_with_their_core_fields(rig_data: Path) -> None:
    lines = (rig_data / "wsm" / "bsm-vectors.jsonl").read_text().splitlines()
    assert len(lines) == 80
    for line in lines:
        record = json.loads(line)
        layers = describe(bytes.fromhex(record["mf"]))
        core = layers["messageframe"]["basic_safety_message"]["core"]
        assert layers["messageframe"]["message_id"] == bsm.MESSAGE_ID
        assert core["msg_cnt"] == record["expect"]["msgCnt"]
        assert core["temporary_id"] == record["expect"]["id"]


@pytest.mark.realdata
def test_the_implicit_certificate_of_a_real_unit_is_described_field_by_field(
    rig_data: Path,
) -> None:
    lines = (rig_data / "wsm" / "real-wsms.jsonl").read_text().splitlines()
    signers = [
        describe(bytes.fromhex(json.loads(line)["wsm"]))["1609.2"]["signer"] for line in lines
    ]
    certificates = [signer["certificates"] for signer in signers if "certificates" in signer]
    assert certificates[0][0] == {
        "hashed_id8": "afc46273f760137e",
        "type": "implicit",
        "issuer": "c620fb90caad3b9c",
        "name": None,
        "binary_id": "0bf083d408e2d0d3",
        "linkage_data": None,
        "craca_id": "396921",
        "crl_series": 3,
        "valid_from_utc_s": 1694082477.0,
        "valid_until_utc_s": 1694082477.0 + 40_380 * 60,
        "app_permissions": [
            _permission(2113686, None, "3040000000"),
            _permission(38, "misbehavior reporting"),
            _permission(132, None),
            _permission(2113689, None),
            _permission(32, "vehicle to vehicle safety and awareness"),
        ],
        "region": [{"country": 840, "regions": (), "subregions": ()}],
        "assurance_level": None,
        "public_key": None,
        "reconstruction_value": "03"
        "06225d3267ae1239960a52da5fc7dd7aa1ecdb944563d71ea9e64f36569ad9ce",
    }


def _permission(
    psid: int, name: str | None, bitmap: str | None = None
) -> dict[str, int | str | None]:
    return {"psid": psid, "psid_name": name, "ssp": bitmap, "is_bitmap_ssp": bitmap is not None}


@pytest.mark.realdata
def test_18_wsms_of_real_units_are_described_down_to_the_bsm_and_not_verified(
    rig_data: Path,
) -> None:
    lines = (rig_data / "wsm" / "real-wsms.jsonl").read_text().splitlines()
    assert len(lines) == 18
    reasons = set()
    for line in lines:
        record = json.loads(line)
        layers = describe(bytes.fromhex(record["wsm"]))
        assert list(layers) == ["wsm", "1609.2", "messageframe"]
        core = layers["messageframe"]["basic_safety_message"]["core"]
        assert core["msg_cnt"] == record["core"]["msgCnt"]
        assert core["temporary_id"] == record["core"]["id"]
        assert core["latitude_deg"] == pytest.approx(record["core"]["lat"] * 1e-7)
        signed = layers["1609.2"]
        assert signed["header_info"]["psid"] == 0x20
        assert signed["verified"] is False
        reasons.add(signed["not_verified_because"])
    assert reasons == {"unknown_certificate", "unknown_issuer"}
