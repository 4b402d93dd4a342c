"""The MAP message of a crossing as a road-side unit takes it, read as the unit reads it."""

import pytest

from onboard.messages import map_data
from onboard.wave_udp import immediate_forward, psid
from onboard.wave_udp.psid import p_decode
from onboard.wave_udp.settings import RadioProfile
from sim_rig.cli import main
from sim_rig.road_side.signal_messages import map_message
from sim_rig.road_side.store_and_repeat import UnitForm, stored_map
from sim_rig.scenario.schema import load_scenario
from tests.terminal import Terminal

SIGNAL = load_scenario("signal", RadioProfile.WAVE)
START_S, STOP_S = 1_790_000_000.0, 1_790_086_400.0
"""2026-09-21 14:13:20 and a day later, UTC."""


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Terminal:
    return Terminal("sim-rig", main, monkeypatch, capsys)


def sent_map() -> map_data.MapData:
    assert SIGNAL.signal is not None
    return map_data.decode(map_data.encode(map_message(SIGNAL, SIGNAL.signal)))


def stored(form: UnitForm) -> str:
    return stored_map(SIGNAL, form, channel=183, index=3, start_s=START_S, stop_s=STOP_S)


def test_a_file_of_rsu_4_1_has_the_map_and_when_it_is_sent() -> None:
    text = stored(UnitForm.RSU41)
    lines = dict(line.split("=") for line in text.splitlines())
    assert lines["DeliveryStart"] == "09/21/2026, 14:13"
    assert lines["DeliveryStop"] == "09/22/2026, 14:13"
    assert (lines["TxInterval"], lines["TxChannel"], lines["Signature"]) == ("1", "183", "True")
    message = immediate_forward.decode(text.encode())
    assert (message.type, message.psid, message.priority) == ("MAP", psid.MAP, 5)
    assert map_data.decode(message.payload) == sent_map()


def test_a_row_of_ntcip_1218_has_the_map_and_when_it_is_sent() -> None:
    words = stored(UnitForm.NTCIP1218).split()
    names, kinds, values = words[::3], words[1::3], words[2::3]
    assert names == [f"1.3.6.1.4.1.1206.4.2.18.3.2.1.{column}.3" for column in range(2, 12)]
    row = dict(zip(range(2, 12), values, strict=True))
    numbers = {column: int(row[column]) for column in range(2, 12) if kinds[column - 2] == "i"}
    assert numbers == {3: 183, 4: 1000, 8: 1, 9: 4, 10: 5}
    octets = {column: bytes.fromhex(row[column]) for column in row.keys() - numbers.keys()}
    assert p_decode(octets[2]) == (psid.MAP, len(octets[2]))
    assert octets[5].hex() == "07ea" + "09" + "15" + "0e" + "0d" + "14" + "00"
    assert octets[6].hex() == "07ea" + "09" + "16" + "0e" + "0d" + "14" + "00"
    assert map_data.decode(octets[7]) == sent_map()
    assert octets[11] == b"\x80"


def test_the_command_prints_it_and_refuses_what_has_no_map(terminal: Terminal) -> None:
    run = terminal.run("map", "signal", "--index", "2")
    assert run.returncode == 0
    assert len(run.stdout.splitlines()) == 10
    for words, expected in (
        (("fig4",), "fig4: the scenario has no signal"),
        (("signal", "--form", "rsu5"), "--form: rsu5 is not one of rsu41, ntcip1218"),
    ):
        refused = terminal.run("map", *words)
        assert refused.returncode == 2
        assert expected in refused.stderr
