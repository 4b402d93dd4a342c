"""The tracked lead that the identification is given, made from a lead of the camera."""

import pytest

from onboard.lcca.events import TrackedLead
from onboard.observations import Lead, LeadIdentity, PlateCandidate


def test_texts_of_one_id_are_one_candidate() -> None:
    """Look-alike characters have one ID: nothing is asked twice, and a replay sees one text."""
    lead = Lead(
        0.0,
        LeadIdentity.UNKNOWN,
        gap_m=20.0,
        track_id=1,
        candidates=(
            PlateCandidate("GN417KB", 0.5),
            PlateCandidate("GN4I7KB", 0.25),
            PlateCandidate("GN477KB", 0.2),
        ),
    )

    vehicle = TrackedLead.of(lead, lambda text: text.replace("I", "1").encode())

    assert vehicle is not None
    assert [(each.text, each.car_id) for each in vehicle.candidates] == [
        ("GN417KB", b"GN417KB"),
        ("GN477KB", b"GN477KB"),
    ]
    assert [each.probability for each in vehicle.candidates] == pytest.approx([0.75, 0.2])


def test_the_error_of_scale_of_the_gap_is_one_of_the_closing_speed() -> None:
    """A closing speed by a camera whose lens is guessed is compared with speeds of BSMs."""
    lead = Lead(0.0, LeadIdentity.UNKNOWN, None, 20.0, 5.0, 8.0, 1.5, track_id=1)

    vehicle = TrackedLead.of(lead, str.encode)

    assert vehicle is not None
    assert vehicle.closing_speed_sigma_m_s == pytest.approx(2.5)
