"""What a step sends is on the air before it is recorded."""

from pathlib import Path

import numpy as np

from onboard.observations import Sensor, Speed
from onboard.recorder.header import RecordingHeader
from onboard.recorder.records import RecordedMessage
from onboard.recorder.settings import RecorderSettings
from onboard.replay.initial_state import InitialState
from onboard.replay.recorded_stack import recorded_stack
from onboard.settings import parse_settings
from onboard.step import SentWsm
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
