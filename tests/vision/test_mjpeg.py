"""JPEGs of multipart streams, in the formats of different cameras."""

import itertools
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.vision.mjpeg import LONGEST_PART, MjpegParts

BODIES = st.binary(max_size=60).map(
    lambda filling: b"\xff\xd8" + filling.replace(b"\xff", b"\x00") + b"\xff\xd9"
)


def stated(body: bytes) -> bytes:
    return b"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n%s\r\n" % (
        len(body),
        body,
    )


def unstated(body: bytes) -> bytes:
    return b"--frame\r\nContent-Type: image/jpeg\r\n\r\n%s\r\n" % body


def wrongly_stated(body: bytes) -> bytes:
    return b"--frame\r\ncontent-length:%d\r\n\r\n%s\r\n" % (len(body) + 3, body)


def bodies_of(stream: bytes, cuts: list[int], boundary: bytes = b"frame") -> list[bytes]:
    parts, taken = MjpegParts(boundary), []
    edges = [0, *sorted(cut % (len(stream) + 1) for cut in cuts), len(stream)]
    for start, end in itertools.pairwise(edges):
        parts.receive_bytes(stream[start:end])
        while (body := parts.next_body()) is not None:
            taken.append(body)
    return taken


@pytest.mark.parametrize("part", [stated, unstated, wrongly_stated])
@given(bodies=st.lists(BODIES, max_size=5), cuts=st.lists(st.integers(0, 1000), max_size=10))
def test_each_image_is_returned_once_however_the_bytes_are_split(
    part: Callable[..., bytes], bodies: list[bytes], cuts: list[int]
) -> None:
    stream = b"".join(part(body) for body in bodies) + b"--frame--\r\n"

    assert bodies_of(stream, cuts) == bodies


@pytest.mark.parametrize("part", [stated, unstated])
def test_an_image_is_returned_before_the_next_begins(part: Callable[..., bytes]) -> None:
    assert bodies_of(part(b"\xff\xd8picture\xff\xd9"), []) == [b"\xff\xd8picture\xff\xd9"]


def test_an_image_of_stated_length_may_contain_the_delimiter() -> None:
    body = b"\xff\xd8 --frame \xff\xd9"

    assert bodies_of(stated(body) + stated(body), []) == [body, body]


@pytest.mark.parametrize("boundary", [b"frame", b"--frame"])
def test_a_boundary_may_be_given_with_its_dashes(boundary: bytes) -> None:
    assert bodies_of(stated(b"\xff\xd8\xff\xd9"), [], boundary) == [b"\xff\xd8\xff\xd9"]


def test_a_part_that_is_no_image_is_returned_and_the_next_is_found() -> None:
    sound = b"\xff\xd8picture\xff\xd9"

    assert bodies_of(unstated(b"garbage") + stated(sound), []) == [b"garbage", sound]


@given(st.lists(st.binary(max_size=200), max_size=10))
def test_noise_never_raises(chunks: list[bytes]) -> None:
    parts = MjpegParts(b"frame")
    for chunk in chunks:
        parts.receive_bytes(b"--frame\r\n\r\n" + chunk)
        while parts.next_body() is not None:
            pass


def test_a_part_without_end_is_dropped_and_the_next_is_found() -> None:
    parts = MjpegParts(b"frame")
    parts.receive_bytes(b"--frame\r\n\r\n" + bytes(LONGEST_PART + 1))
    parts.receive_bytes(stated(b"\xff\xd8picture\xff\xd9"))

    assert parts.next_body() == b"\xff\xd8picture\xff\xd9"
