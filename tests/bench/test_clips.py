"""Scores of clips against what a person sees in them."""

import pytest

from bench.clips import LabelledFrame, labels, score
from onboard.observations import ImageBox, Lead, LeadIdentity
from onboard.tools.see.annotated_frame import AnnotatedFrame
from onboard.vision.frames import NO_IMAGE, Frame

CAR, ELSEWHERE = ImageBox(200.0, 120.0, 40.0, 30.0), ImageBox(20.0, 300.0, 60.0, 12.0)
PLATE = ImageBox(214.0, 138.0, 10.0, 4.0)
FPS = 10.0


def frames(*leads: Lead) -> list[AnnotatedFrame]:
    return [
        AnnotatedFrame(index, Frame(index / FPS, NO_IMAGE), (lead,))
        for index, lead in enumerate(leads)
    ]


def lead_at(box: ImageBox | None, gap_m: float = 12.0, closing_m_s: float = 0.0) -> Lead:
    return Lead(
        0.0, LeadIdentity.UNKNOWN, gap_m=gap_m, closing_speed_m_s=closing_m_s, track_id=1, box=box
    )


NOTHING, UNKNOWN = Lead(0.0, LeadIdentity.NO_LEAD), Lead(0.0, LeadIdentity.UNKNOWN)
AHEAD = LabelledFrame(CAR, is_free=False, vehicles=(CAR,))
FREE = LabelledFrame(None, is_free=True, vehicles=())


def test_a_lead_is_found_unknown_or_overlooked() -> None:
    answers = [lead_at(PLATE), UNKNOWN, NOTHING, lead_at(ELSEWHERE)]

    tally = score(frames(*answers), dict.fromkeys(range(4), AHEAD))

    assert (tally.with_vehicle, tally.found, tally.unknown, tally.no_lead) == (4, 1, 1, 1)


def test_only_no_lead_says_that_the_lane_is_free() -> None:
    tally = score(frames(NOTHING, UNKNOWN), dict.fromkeys(range(2), FREE))

    assert (tally.free, tally.said_free) == (2, 1)


def test_a_near_lead_on_no_vehicle_is_a_ghost_for_as_long_as_it_lasts() -> None:
    answers = [lead_at(PLATE), *[lead_at(ELSEWHERE)] * 4, lead_at(ELSEWHERE, gap_m=31.0), NOTHING]

    tally = score(frames(*answers), {0: AHEAD, 6: AHEAD})

    assert tally.ghosts_s == pytest.approx([0.4])


def test_a_vehicle_of_either_neighbouring_labelled_frame_is_no_ghost() -> None:
    tally = score(frames(NOTHING, lead_at(PLATE), lead_at(PLATE)), {0: FREE, 2: AHEAD})

    assert tally.ghosts_s == []


def test_a_collision_within_a_second_is_absurd() -> None:
    answers = [lead_at(CAR, 0.2, 14.6), lead_at(CAR, 3.0, 2.0), lead_at(CAR, 90.0, -50.0)]

    assert score(frames(*answers), {0: AHEAD}).absurd == 2


def test_the_labels_are_of_six_clips_and_each_frame_states_its_own_lane() -> None:
    clips = labels()

    assert len(clips) == 6
    assert sum(len(each) for each in clips.values()) == 186
    assert all(
        not (frame.is_free and frame.own) for each in clips.values() for frame in each.values()
    )
