"""Replays of drives with whatever the camera says of the lead."""

import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.observations import Lead, LeadIdentity, PlateCandidate
from onboard.recorder.reader import RecordedDrive
from onboard.replay.replay import compare
from tests.recorder.drive import AHEAD, BEHIND, SIMILAR, START_UTC_S, STEP_S, record_drive

texts = st.sampled_from((AHEAD, BEHIND, *SIMILAR, "GN4I7KB", "GN417KB0"))
"""The plates of both vehicles, misread ones, and one with the ID of another."""
EPOCH_ENDS_UTC_S = START_UTC_S + 20.0

candidates = st.lists(st.builds(PlateCandidate, texts, st.floats(0.0, 1.0)), max_size=20).map(tuple)
leads = st.just(Lead(0.0, LeadIdentity.NO_LEAD)) | st.builds(
    Lead,
    st.just(0.0),
    st.just(LeadIdentity.UNKNOWN),
    gap_m=st.floats(1.0, 60.0),
    gap_sigma_m=st.just(0.3),
    closing_speed_m_s=st.none() | st.floats(-20.0, 20.0),
    closing_speed_sigma_m_s=st.none() | st.just(0.3),
    track_id=st.none() | st.integers(0, 2),
    candidates=candidates,
)


@pytest.mark.long
@settings(max_examples=25, deadline=None)
@given(sections=st.lists(st.tuples(leads, st.integers(1, 8)), min_size=4, max_size=8))
def test_a_replay_equals_the_recording_whatever_the_candidates(
    sections: list[tuple[Lead, int]],
) -> None:
    """Empty and oversized lists, the own plate, one ID twice, and an epoch that ends meanwhile."""
    seen = [lead for lead, frames in sections for _ in range(frames)]
    with tempfile.TemporaryDirectory() as folder:
        drive = RecordedDrive(
            [
                record_drive(
                    Path(folder),
                    len(seen) * STEP_S,
                    start_utc_s=EPOCH_ENDS_UTC_S - len(seen) * STEP_S / 2,
                    leads=seen,
                )
            ]
        )

        comparison = compare(drive)

        assert comparison.difference is None
        content = b"".join(entry.data for entry in drive.entries())
    assert not any(plate.encode() in content for plate in (AHEAD, BEHIND, *SIMILAR))
