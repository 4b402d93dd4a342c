"""Footers read into arrays are those that their declaration decodes, valid and invalid ones."""

import dataclasses
from collections.abc import Callable

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from onboard.errors import DecodeError
from onboard.messages import mvs_footer
from onboard.messages.mvs_footer import MvsFooter, ObserverRun
from onboard.mvs import footer_reading
from onboard.mvs.footer_coding import from_correlations
from onboard.tracking.evidence import measurement_id

OBSERVERS = (b"1111", b"2222", b"\xff\xff\xff\xff")
REFERENCE_MS = 1_790_000_000_000


def footer(seed: int) -> bytes:
    """Encoded, mostly valid; many octets are 0 or 255. Drawn field by field, it would cost most."""
    rng = np.random.default_rng(seed)

    def octets(count: int) -> bytes:
        ends = rng.choice([0, 255, -1, -1], count)
        return np.where(ends < 0, rng.integers(0, 256, count), ends).astype(np.uint8).tobytes()

    measurements, estimates = (int(each) for each in rng.integers(0, 4, 2))
    entries = [
        bytes([rng.integers(len(OBSERVERS))]) + octets(mvs_footer.MEASUREMENT.size_bytes - 1)
        for _ in range(measurements)
    ]
    for _ in range(estimates):
        runs = tuple(
            ObserverRun(at, tuple(rng.permutation(4096)[: rng.integers(1, 17)].tolist()))
            for at in range(rng.integers(1, len(OBSERVERS) + 1))
        )
        entries.append(octets(mvs_footer.STATE.size_bytes - 1) + bytes([len(runs)]))
        entries.append(mvs_footer._encode_provenance(runs))
    head = mvs_footer.encode(MvsFooter(REFERENCE_MS, 48.1, 11.5, OBSERVERS, (), ()))
    counts = mvs_footer.HEADER.size_bytes - 2
    return b"".join([head[:counts], bytes([measurements, estimates]), head[counts + 2 :], *entries])


footers = st.integers(0, 2**32 - 1).map(footer)
changes = st.sampled_from(("none", "octet", "bit", "cut", "insertion"))


def refusal(read: Callable[[bytes], object], data: bytes) -> str:
    try:
        read(data)
    except DecodeError as error:
        return str(error)
    return ""


def mutated(data: bytes, at: int, change: str, octet: int) -> bytes:
    at %= len(data)
    match change:
        case "octet":
            return data[:at] + bytes([octet]) + data[at + 1 :]
        case "bit":
            return data[:at] + bytes([data[at] ^ 1 << octet % 8]) + data[at + 1 :]
        case "cut":
            return data[:at]
        case "insertion":
            return data[:at] + bytes([octet]) + data[at:]
        case _:
            return data


@given(
    footers,
    changes,
    st.integers(0, 400),
    st.integers(0, 255),
)
def test_reading_gives_what_the_declaration_gives(
    data: bytes, change: str, at: int, octet: int
) -> None:
    data = mutated(data, at, change, octet)
    assert refusal(footer_reading.read, data) == refusal(mvs_footer.decode, data)
    if refusal(mvs_footer.decode, data):
        return

    declared, came = mvs_footer.decode(data), footer_reading.read(data)

    measured, estimated = declared.measurements, declared.estimates
    assert (came.anchor.latitude_deg, came.anchor.longitude_deg) == (
        declared.latitude_deg,
        declared.longitude_deg,
    )
    assert came.observers == frozenset(declared.observers)
    cars = [each.car for each in measured] + [each.state.car for each in estimated]
    assert [*came.numbers] == cars
    assert came.has_speed.tolist() == [0.0] * len(measured) + [1.0] * len(estimated)

    def identity(observer: int, age_ms: int) -> int:
        return measurement_id(declared.observers[observer], declared.reference_ms - age_ms)

    assert [*came.provenances] == [
        *({identity(each.observer, each.age_ms)} for each in measured),
        *(
            {identity(run.observer, age_ms) for run in each.provenance for age_ms in run.ages_ms}
            for each in estimated
        ),
    ]
    stated = [dataclasses.astuple(each.state) for each in estimated]
    assert came.states.tolist() == [
        *([each.east_m, each.north_m, 0.0, 0.0] for each in measured),
        *(list(state[1:5]) for state in stated),
    ]
    for each, covariance in zip(measured, came.covariances, strict=False):
        sigmas, correlation = [[each.sigma_east_m, each.sigma_north_m]], [[each.correlation]]
        (expected,) = from_correlations(np.array(sigmas), np.array(correlation))
        assert (covariance[:2, :2] == expected).all()
        assert not covariance[2:].any()
    for state, covariance in zip(stated, came.covariances[len(measured) :], strict=True):
        (expected,) = from_correlations(np.array([state[5:9]]), np.array([state[9:15]]))
        np.testing.assert_allclose(covariance, expected, rtol=1e-12)


@given(st.lists(st.tuples(footers, st.integers(0, 400), changes, st.integers(0, 255)), max_size=4))
def test_footers_read_together_are_each_read_alone(
    some: list[tuple[bytes, int, str, int]],
) -> None:
    data = [mutated(*each) for each in some]

    together = footer_reading.read_together(data)

    for each, entries in zip(data, together, strict=True):
        if isinstance(entries, DecodeError):
            assert str(entries) == refusal(footer_reading.read, each)
            continue
        alone = footer_reading.read(each)
        assert entries.provenances == alone.provenances
        assert (entries.numbers, entries.observers) == (alone.numbers, alone.observers)
        assert (entries.spans.counts == alone.spans.counts).all()
        assert (entries.has_speed == alone.has_speed).all()
        assert (entries.states == alone.states).all()
        np.testing.assert_allclose(entries.covariances, alone.covariances, rtol=1e-12)


@given(st.binary(max_size=60), st.binary(max_size=300))
def test_any_bytes_are_read_or_refused_as_by_the_declaration(header: bytes, rest: bytes) -> None:
    for data in (header, bytes([mvs_footer.VERSION]) + header, footer_of_counts(header) + rest):
        assert refusal(footer_reading.read, data) == refusal(mvs_footer.decode, data)


def footer_of_counts(counts: bytes) -> bytes:
    """Header with small numbers of observers, measurements and estimates."""
    whole = mvs_footer.encode(MvsFooter(REFERENCE_MS, 48.1, 11.5, (), (), ()))
    small = [octet % 4 for octet in (counts + bytes(3))[:3]]
    return whole[: mvs_footer.HEADER.size_bytes - 3] + bytes(small)
