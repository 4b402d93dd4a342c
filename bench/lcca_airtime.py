"""Airtime of LCCA messages in a warning group at rest, beside that of BSMs.

Eight cars drive at 20 m/s with gaps of 20 m, in virtual time, with signatures and positions. All
are in range of each other; counted from when the group has formed.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

from bench import Figure
from onboard.settings import parse_settings
from sim_rig.radio.ofdm import airtime_s, psdu_bytes
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.radio_settings import CsmaSettings
from sim_rig.scenario.schema import Scenario

CARS, SPEED_M_S, APART_M = 8, 20.0, 24.5
FORMED_S, COUNTED_S = 6.0, 12.6
"""Counted are six refreshes of each membership."""
LOSSES = (0.0, 0.1)
"""Of messages on the air."""


@dataclass
class _Sent:
    """What all vehicles have sent."""

    messages: Counter[str] = field(default_factory=Counter)
    """By kind."""
    lcca_s: float = 0.0
    bsms_s: float = 0.0
    """Airtimes."""


def measure() -> Iterator[Figure]:
    """Yield airtime, and joins and replies of a vehicle, for each share of lost messages."""
    of = CARS * COUNTED_S
    for loss in LOSSES:
        sent = _sent(loss)
        bsms = sent.messages.pop("bsm")
        lcca, asked = sent.messages.total(), sent.messages["join"] + sent.messages["reply"]
        name = f"lcca_airtime.{loss:g}_lost"
        yield Figure(f"{name}.all", sent.lcca_s / of, "s/s", lcca, "BSMs", sent.bsms_s / of)
        yield Figure(f"{name}.joins_and_replies", asked / of, "1/s", asked, "BSMs", bsms / of)


def _sent(loss: float) -> _Sent:
    log = run_virtual(_row(loss))
    sent = _Sent()
    for car in log.traces:
        for record in log.of(car, "sent", from_s=FORMED_S):
            sent.messages[record["message"]] += 1
            sent.lcca_s += _airtime_s(record["size_bytes"])
    for record in log.rig:
        if record["kind"] == "on_air" and log.at_s(record) >= FORMED_S:
            sent.messages["bsm"] += 1
            sent.bsms_s += _airtime_s(record["size_bytes"])
    sent.bsms_s -= sent.lcca_s
    sent.messages["bsm"] -= sent.messages.total() - sent.messages["bsm"]
    return sent


def _row(loss: float) -> Scenario:
    cars = {
        f"car{number}": {
            "plate": f"K{'ABCDEFGH'[number]}{147 * (number + 1) % 1000:03d}{'HLNPRTVX'[number]}T",
            "start_m": 1000.0 - APART_M * number,
            "speed_m_s": SPEED_M_S,
        }
        for number in range(CARS)
    }
    tree = {
        "title": "A warning group drives on as it does.",
        "seed": 1,
        "duration_s": FORMED_S + COUNTED_S,
        "radio": {"reach_m": 300.0, "loss": loss},
        "lens": {"width_px": 1280, "focal_px": 3300.0},
        "gnss": {},
        "signed": True,
        "cars": cars,
        "expect": [],
    }
    return parse_settings(tree, Scenario, __name__)


def _airtime_s(octets: int) -> float:
    return airtime_s(psdu_bytes(octets), CsmaSettings().data_rate_mbit_s)
