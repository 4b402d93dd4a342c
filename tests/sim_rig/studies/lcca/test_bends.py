"""A row of cars in a bend is a warning group if something tells the cars that they turn."""

import pytest

from sim_rig.studies.lcca.bends_study import (
    BEND_S,
    STUDY,
    BendRow,
    BendSettings,
    Source,
    scenario_of,
    table,
)


def row_of(source: Source, radius_m: int) -> BendRow:
    settings = BendSettings(radii_m=(radius_m,), sources=(source,), seeds=(2,), cars=4)
    return STUDY.one(settings, 0)


@pytest.mark.long
@pytest.mark.parametrize("radius_m", [150, 600])
def test_with_a_yaw_rate_a_row_is_one_group_in_a_bend_without_lines(radius_m: int) -> None:
    assert row_of("yaw rate", radius_m).holds


@pytest.mark.long
def test_without_lines_or_anything_that_tells_the_bend_it_is_none() -> None:
    row = row_of("nothing", 300)

    assert row.leaves > 0
    assert row.warned == 0


@pytest.mark.long
def test_lines_alone_tell_the_bend() -> None:
    assert row_of("lines", 300).holds


@pytest.mark.parametrize("radius_m", [150, 1000])
def test_the_scenario_bends_with_the_radius_to_the_side_that_the_seed_draws(radius_m: int) -> None:
    settings = BendSettings(radii_m=(radius_m,), seeds=tuple(range(1, 9)))
    bends = [
        scenario_of(settings, case).roads["road"].bends[0] for case in STUDY.cases(settings)[:8]
    ]

    assert {abs(bend.radius_m) for bend in bends} == {radius_m}
    assert {bend.radius_m > 0 for bend in bends} == {True, False}
    assert all(bend.until_m - bend.from_m >= 10.0 * BEND_S for bend in bends)


def test_a_line_counts_the_rows_that_held() -> None:
    row = BendRow(600, "yaw rate", 1.0, 0, 5, 5, 0.01)
    left = BendRow(600, "yaw rate", 0.9, 1, 5, 5, 0.01)
    unwarned = BendRow(600, "yaw rate", 1.0, 0, 4, 5, 0.01)

    (line,) = table(BendSettings(), [row, left, unwarned])

    assert (line.rows, line.held, line.all_warned, line.leaves) == (3, 1, 2, 1)
    assert line.member_share == pytest.approx(2.9 / 3)
