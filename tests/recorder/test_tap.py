"""What is recorded of a step, and when: what it sends is on the air before it is recorded."""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from unittest.mock import create_autospec

import numpy as np
import pytest

from onboard.intersections.intersections import SignalAhead
from onboard.observations import Sensor, Speed
from onboard.recorder.header import RecordingHeader
from onboard.recorder.identities import Aliases
from onboard.recorder.records import RecordedMessage
from onboard.recorder.settings import RecorderSettings
from onboard.replay.initial_state import InitialState
from onboard.replay.recorded_stack import recorded_stack
from onboard.replay.tap import Tap
from onboard.settings import parse_settings
from onboard.step import Input, ProgramMessage, ReceivedWsm, SentWsm, StepOutputs
from onboard.trace.trace_line import Event
from onboard.vehicle.stack import Stack
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage
from tests.recorder.drive import AHEAD, START_S, START_UTC_S, config


class Order:
    """A `RecordWriter` and a radio: what happens in which order."""

    def __init__(self, folder: Path) -> None:
        self.settings = parse_settings({"folder": str(folder)}, RecorderSettings, "recorder")
        self.seen: list[str] = []

    def begin(self, header: RecordingHeader) -> None:
        pass

    def record(self, record: RecordedMessage) -> None:
        self.seen.append(record.topic)

    def send(self, _wsm: SentWsm) -> None:
        self.seen.append("sent")


def test_a_message_is_sent_before_it_is_recorded_and_after_what_led_to_it(tmp_path: Path) -> None:
    order = Order(tmp_path)
    initial = InitialState(
        config=config(AHEAD),
        sensors=frozenset({Sensor.SPEED}),
        seed=np.random.SeedSequence(1),
        now=START_S,
        utc_s=START_UTC_S,
    )
    stack = recorded_stack(order, initial)
    now = START_S
    while "sent" not in order.seen:
        order.seen.clear()
        now += 0.01
        stack.step([Speed(now, 15.0, 0.28, "obd:7E8")], now, send=order.send)

    assert [each for each in order.seen if each in ("/in/speed", "sent", "/out/wsm")] == [
        "/in/speed", "sent", "/out/wsm",
    ]  # fmt: skip


GROUPS = 0x4050
"""PSID of the group messages, by the configuration."""


def recorded_without_positions(inputs: Sequence[Input], events: list[Event]) -> list[str]:
    """Record one step of cores that put out `events`, and return the topics."""
    stack = create_autospec(Stack)

    def step(given: Iterable[Input], *_: object) -> StepOutputs:
        assert list(given) == inputs
        return StepOutputs([], [], events, math.inf)

    stack.step.side_effect = step
    recorded: list[RecordedMessage] = []
    aliases = Aliases(in_clear=True)
    begins = START_S, START_UTC_S
    tap = Tap(stack, recorded.append, aliases, begins, lcca_psid=GROUPS, positions=False)
    tap.step(inputs, START_S)
    return [each.topic for each in recorded]


FREE = [GROUPS, psid.PEER_TO_PEER, psid.CRL]


@pytest.mark.parametrize(
    ("service", "topics"),
    [(each, ["/in/wsm", "/in/program_message", "/in/step"]) for each in FREE]
    + [(each, ["/in/step"]) for each in (*sorted(psid.J2735), psid.LCCA, 0x4055)],
)
def test_without_positions_no_message_that_may_have_a_place_is_recorded(
    service: int, topics: list[str]
) -> None:
    """A MAP, or a pedestrian's PSM, tells where the vehicle is as well as a BSM does.

    So may what other programs send, of which nothing is known.
    """
    data = b"\x03\x80\x00"
    wsm = wsmp.encode(WaveShortMessage(service, data))
    inputs: list[Input] = [ReceivedWsm(START_S, wsm), ProgramMessage(START_S, service, 3, data)]

    assert recorded_without_positions(inputs, []) == topics


def test_without_positions_no_crossing_is_recorded() -> None:
    ahead = SignalAhead(START_S, intersection=12109, lane_id=1, distance_m=40.0)

    assert recorded_without_positions([], [ahead]) == ["/in/step"]
