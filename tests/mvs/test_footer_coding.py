"""Evidence to footer and back, between cars with different frames."""

from bisect import bisect_right

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import mvs_footer
from onboard.mvs.footer_coding import (
    Entry,
    encode_within,
    footer_of,
    free_number,
    from_correlations,
    to_correlations,
)
from onboard.mvs.footer_reading import read
from onboard.mvs.received_footers import SharedEntries, evidence_in
from onboard.tracking.evidence import Estimate, Evidence, Measurement, measurement_id
from onboard.tracking.fusion import fuse

SENDER, RECEIVER = LocalFrame(48.1, 11.5), LocalFrame(48.12, 11.53)
ANCHOR = LocalFrame(48.1012345, 11.5012345)


def some_evidence(rng: np.random.Generator, cars: int) -> list[Entry]:
    entries: list[Entry] = []
    for car in range(cars):
        measurements = [
            Measurement(
                measurement_id(observer, 99_900 - 100 * k - 7 * at - car),
                rng.normal((30 * car - 150, 10 * car), 1.0),
                np.array([[0.5, 0.1], [0.1, 0.3]]),
            )
            for at, observer in enumerate((b"aaaa", b"bbbb"))
            for k in range(3)
        ]
        pieces: list[Evidence] = [*fuse([measurements], 1.0)] if car % 3 else [measurements[0]]
        entries += [(car, piece) for piece in pieces]
    return entries


def read_bytes(data: bytes) -> SharedEntries:
    return read(data)


def test_what_was_sent_is_in_the_receivers_frame_what_it_was_in_the_senders() -> None:
    sent = some_evidence(np.random.default_rng(0), 9)
    data, _ = encode_within(sent, 100_000, SENDER, ANCHOR, 1000)

    came = evidence_in(read_bytes(data), RECEIVER)

    by_provenance = {piece.provenance: piece for piece in came if isinstance(piece, Estimate)}
    mapping = RECEIVER.mapping_from(SENDER)
    for piece in (piece for _, piece in sent if isinstance(piece, Estimate)):
        expected, got = piece.mapped(*mapping), by_provenance[piece.provenance]
        assert np.abs(expected.state[:2] - got.state[:2]).max() < 0.02
        assert np.abs(expected.state[2:] - got.state[2:]).max() < 0.02
        # No more is claimed than was known, and hardly less.
        relative = np.linalg.eigvals(np.linalg.solve(expected.covariance, got.covariance)).real
        assert relative.min() > 0.97
        assert relative.max() < 1.07
    measured = [piece for piece in came if isinstance(piece, Measurement)]
    assert [piece.id for piece in measured] == [
        piece.id for _, piece in sent if isinstance(piece, Measurement)
    ]


def test_what_does_not_fit_is_left_out_from_the_end() -> None:
    sent = some_evidence(np.random.default_rng(0), 12)
    whole, _ = encode_within(sent, 100_000, SENDER, ANCHOR, 1400)

    data, fitting = encode_within(sent, 100_000, SENDER, ANCHOR, 200)

    assert len(data) <= 200 < len(whole)
    came = {piece.provenance for piece in evidence_in(read_bytes(data), SENDER)}
    assert came == {piece.provenance for _, piece in sent[: len(came)]}
    assert fitting == sent[: len(came)]
    data, fitting = encode_within(sent, 100_000, SENDER, ANCHOR, 18)
    assert evidence_in(read_bytes(data), SENDER) == []
    assert fitting == []


def test_as_many_entries_are_sent_as_fit() -> None:
    provenance = frozenset(measurement_id(b"cccc", 100_000 - k) for k in range(40))
    estimate = Estimate(provenance, np.zeros(4), np.eye(4))
    sent = [*some_evidence(np.random.default_rng(0), 6), (9, estimate)]
    firsts = [footer_of(sent[:count], 100_000, SENDER, ANCHOR) for count in range(8)]
    sizes = [len(mvs_footer.encode(each)) for each in firsts]
    for most_bytes in [*sizes, *(size - 1 for size in sizes[1:])]:
        data, fitting = encode_within(sent, 100_000, SENDER, ANCHOR, most_bytes)
        assert len(fitting) == bisect_right(sizes, most_bytes) - 1
        assert data == mvs_footer.encode(firsts[len(fitting)])


def test_what_is_too_old_or_not_yet_is_not_sent() -> None:
    pieces = [
        (0, Measurement(measurement_id(b"aaaa", stamp_ms), np.zeros(2), np.eye(2)))
        for stamp_ms in (95_904, 95_905, 100_000, 100_001)
    ]

    data, _ = encode_within(pieces, 100_000, SENDER, ANCHOR, 1000)
    footer = mvs_footer.decode(data)

    assert [entry.age_ms for entry in footer.measurements] == [4095, 0]


def test_a_long_provenance_is_several_runs_of_an_observer() -> None:
    provenance = frozenset(measurement_id(b"aaaa", 100_000 - k) for k in range(40))
    estimate = Estimate(provenance, np.zeros(4), np.eye(4))

    footer = footer_of([(7, estimate)], 100_000, SENDER, ANCHOR)

    assert [len(run.ages_ms) for run in footer.estimates[0].provenance] == [16, 16, 8]
    (came,) = evidence_in(read_bytes(mvs_footer.encode(footer)), SENDER)
    assert came.provenance == provenance


def test_more_observers_than_a_footer_can_name_are_left_out_from_the_end() -> None:
    pieces = [
        (k, Measurement(measurement_id(k.to_bytes(4), 100_000), np.zeros(2), np.eye(2)))
        for k in range(300)
    ]

    data, _ = encode_within(pieces, 100_000, SENDER, ANCHOR, 10_000)

    assert len(mvs_footer.decode(data).observers) == 255


@given(st.integers(0, 2**32 - 1), st.sampled_from([2, 4]))
def test_a_covariance_is_its_deviations_and_partial_correlations(seed: int, n: int) -> None:
    root = np.random.default_rng(seed).normal(size=(n, n))
    covariance = root @ root.T + 0.01 * np.eye(n)

    sigmas, correlations = to_correlations(covariance)

    assert all(-1 < correlation < 1 for correlation in correlations)
    again = from_correlations(np.array([sigmas]), np.array([correlations]))[0]
    np.testing.assert_allclose(again, covariance)


@given(
    st.lists(st.floats(0.01, 100), min_size=4, max_size=4),
    st.lists(st.floats(-127 / 128, 127 / 128), min_size=6, max_size=6),
)
def test_any_deviations_and_correlations_are_a_positive_covariance(
    sigmas: list[float], correlations: list[float]
) -> None:
    covariance = from_correlations(np.array([sigmas]), np.array([correlations]))[0]

    assert (covariance == covariance.T).all()
    np.linalg.cholesky(covariance)
    assert np.sqrt(np.diagonal(covariance)) == pytest.approx(sigmas)


def test_a_car_keeps_the_number_that_its_sender_gave_it() -> None:
    measured, estimated = some_evidence(np.random.default_rng(0), 2)
    entries = [(300, measured[1]), (2, estimated[1])]

    data, _ = encode_within(entries, 100_000, SENDER, ANCHOR, 1000)
    decoded = read_bytes(data)

    assert decoded.numbers == (300 % 256, 2)
    assert decoded.observers == {b"aaaa", b"bbbb"}


def test_a_number_on_the_wire_is_free_as_long_as_one_is() -> None:
    assert free_number(5, set()) == 5
    assert free_number(261, {5, 6, None}) == 7
    assert free_number(511, {255}) == 0
    assert free_number(261, set(range(256))) == 5
