"""Decoding and encoding of BSMs, compared with asn1tools on the same bits without units.

asn1tools uses the grammar of the tests' oracle; its open types need one call each.
"""

import statistics
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import asn1tools

from bench import Figure
from bench._messages import bsm as example
from onboard.messages import bsm

GRAMMAR = Path(__file__).parents[1] / "tests" / "messages" / "bsm_oracle.asn1"
MESSAGES = 500
REPEATS = 7


def measure() -> Iterator[Figure]:
    """Yield messages a second of processor time, for decoding and encoding."""
    grammar = asn1tools.compile_files(str(GRAMMAR), "uper")
    messages = [example(0, car, 0) for car in range(MESSAGES)]
    frames = [bsm.encode(message) for message in messages]
    trees = [_decode(grammar, frame) for frame in frames]
    pairs: list[tuple[str, Callable[[], object], Callable[[], object]]] = [
        (
            "codec.decode",
            lambda: [bsm.decode(frame) for frame in frames],
            lambda: [_decode(grammar, frame) for frame in frames],
        ),
        (
            "codec.encode",
            lambda: [bsm.encode(message) for message in messages],
            lambda: [_encode(grammar, tree) for tree in trees],
        ),
    ]
    for name, work, reference_work in pairs:
        rates = [(rate_hz(work), rate_hz(reference_work)) for _ in range(REPEATS)]
        value, reference = (statistics.median(column) for column in zip(*rates, strict=True))
        yield Figure(name, value, "messages/s", REPEATS, "asn1tools", reference)


def _decode(grammar: Any, frame: bytes) -> Any:
    message = grammar.decode("Bsm", grammar.decode("Frame", frame)["value"])
    for part in message["parts"]:
        part["value"] = grammar.decode("Safety", part["value"])
    return message


def _encode(grammar: Any, message: Any) -> Any:
    parts = [part | {"value": grammar.encode("Safety", part["value"])} for part in message["parts"]]
    value = grammar.encode("Bsm", message | {"parts": parts})
    return grammar.encode("Frame", {"messageId": bsm.MESSAGE_ID, "value": value})


def rate_hz(work: Callable[[], object]) -> float:
    """Return `MESSAGES` per second of processor time that `work` takes."""
    start = time.process_time()
    work()
    return MESSAGES / (time.process_time() - start)
