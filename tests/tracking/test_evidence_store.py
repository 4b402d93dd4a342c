"""The numbers of evidence stay with their piece, wherever they stand."""

import numpy as np

from onboard.tracking.evidence import Estimate, Measurement, as_arrays, measurement_id
from onboard.tracking.evidence_store import EvidenceStore

PLACED = Measurement(measurement_id(b"seer", 1000), np.array([3.0, 4.0]), np.diag([1.0, 2.0]))
WHOLE = Estimate(
    frozenset({measurement_id(b"seer", 900), measurement_id(b"seer", 950)}),
    np.array([1.0, 2.0, 3.0, 4.0]),
    np.diag([1.0, 2.0, 3.0, 4.0]),
)


def test_what_is_put_is_found_again() -> None:
    store = EvidenceStore()
    store.append(as_arrays([WHOLE, WHOLE]))
    row = store.append(as_arrays([PLACED, WHOLE]))

    placed = store.piece(PLACED.provenance, row, is_measurement=True)
    whole = store.piece(WHOLE.provenance, row + 1, is_measurement=False)

    assert row == 2
    assert isinstance(placed, Measurement)
    assert (placed.position_m == PLACED.position_m).all()
    assert (placed.covariance == PLACED.covariance).all()
    assert isinstance(whole, Estimate)
    assert (whole.state == WHOLE.state).all()
    assert (whole.covariance == WHOLE.covariance).all()
    assert whole.stamp_ms == 950


def test_it_grows_and_keeps_what_is_wanted() -> None:
    store = EvidenceStore()
    for at in range(3000):
        piece = Measurement(measurement_id(b"seer", at), np.array([at, -at], float), np.eye(2))
        assert store.append(as_arrays([piece])) == at
    assert store.is_sparse(1000)

    store.compact([2999, 7, 1500])

    assert not store.is_sparse(3)
    assert store.at([0, 1, 2]).states[0].tolist() == [2999.0, 7.0, 1500.0]
    assert store.append(as_arrays([PLACED])) == 3


def test_a_piece_once_made_stays_as_it_is() -> None:
    store = EvidenceStore()
    row = store.append(as_arrays([WHOLE]))
    piece = store.piece(WHOLE.provenance, row, is_measurement=False)

    store.change_frame(np.array([[0.0, -1.0], [1.0, 0.0]]), np.array([10.0, 20.0]))

    assert isinstance(piece, Estimate)
    assert piece.state.tolist() == [1.0, 2.0, 3.0, 4.0]
    assert store.at([row]).states[:, 0].tolist() == [8.0, 21.0, -4.0, 3.0]
