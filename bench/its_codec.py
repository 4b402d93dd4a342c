"""Decoding and encoding of CAMs, compared with BSMs that say the same of the same vehicles."""

import statistics
from collections.abc import Callable, Iterator

from bench import Figure
from bench._messages import UTC_S
from bench._messages import bsm as example
from bench.codec import MESSAGES, REPEATS, rate_hz
from onboard.its_g5.awareness import bsm_of, cam_of
from onboard.messages import bsm, cam


def measure() -> Iterator[Figure]:
    """Yield messages a second of processor time; `vehicle` is with the change to a BSM and back."""
    messages = [example(0, car, 0) for car in range(MESSAGES)]
    cams = [cam_of(message, UTC_S, low_frequency=True) for message in messages]
    frames, sent = [bsm.encode(each) for each in messages], [cam.encode(each) for each in cams]
    pairs: list[tuple[str, Callable[[], object], Callable[[], object]]] = [
        (
            "its_codec.decode",
            lambda: [cam.decode(each) for each in sent],
            lambda: [bsm.decode(each) for each in frames],
        ),
        (
            "its_codec.encode",
            lambda: [cam.encode(each) for each in cams],
            lambda: [bsm.encode(each) for each in messages],
        ),
        (
            "its_codec.decode_vehicle",
            lambda: [bsm_of(cam.decode(each), UTC_S) for each in sent],
            lambda: [bsm.decode(each) for each in frames],
        ),
        (
            "its_codec.encode_vehicle",
            lambda: [cam.encode(cam_of(each, UTC_S, low_frequency=True)) for each in messages],
            lambda: [bsm.encode(each) for each in messages],
        ),
    ]
    for name, work, reference_work in pairs:
        rates = [(rate_hz(work), rate_hz(reference_work)) for _ in range(REPEATS)]
        value, reference = (statistics.median(column) for column in zip(*rates, strict=True))
        yield Figure(name, value, "messages/s", REPEATS, "bsm", reference)
