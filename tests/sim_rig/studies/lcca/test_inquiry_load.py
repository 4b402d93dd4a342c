"""Many cars that ask for 16 texts each leave room on the channel for BSMs."""

from pathlib import Path

import pytest

from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.lcca.inquiry_load_study import CASES, STUDY, InquiryLoadSettings, LoadRow

FEW = InquiryLoadSettings(cars=12, seconds=2.0)


def both(case: str) -> tuple[LoadRow, LoadRow]:
    """The first second, and the rest."""
    number = 2 * CASES.index(case)
    return STUDY.one(FEW, number), STUDY.one(FEW, number + 1)


def test_the_lead_is_found_out_and_no_longer_asked_for() -> None:
    first, rest = both("all ask, the lead answers")

    assert first.identified == rest.identified == 11  # nobody is ahead of the first
    assert first.inquiries_per_s >= 12
    assert rest.inquiries_per_s < first.inquiries_per_s / 4


def test_inquiries_that_nobody_answers_become_rare() -> None:
    first, rest = both("all ask, nobody answers")

    assert rest.identified == rest.answers_per_s == 0
    assert rest.inquiries_per_s <= 1.5 * 12
    assert first.busy_ratio > rest.busy_ratio


@pytest.mark.long
def test_the_table_has_a_line_for_each_case_and_time(tmp_path: Path) -> None:
    summary = STUDY.write(tmp_path, FEW, Workers())

    assert summary.startswith("the channel is busy ")
    lines = (tmp_path / "table.csv").read_text().splitlines()
    assert len(lines) == 1 + 2 * len(CASES)
    silent = STUDY.one(FEW, 0)
    assert silent.bsms_received == pytest.approx(1.0, abs=0.15)
    assert silent.inquiries_per_s == 0
