"""The studies of driver-based access on small samples, and their vectorised sums."""

import csv
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from onboard.access.driver_model import DEFAULT_POPULATION
from onboard.errors import UserError
from onboard.settings import Settings
from sim_rig.cli import app
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.campaigns.catalogue import find_study, study_names
from sim_rig.studies.rakhshan.best_access import RakhshanSettings, gain, simulate
from sim_rig.studies.rakhshan.chain import lane_links, reception_delay_s
from sim_rig.studies.rakhshan.drivers import DriversSettings, fit_population, simulate_reactions
from sim_rig.studies.rakhshan.highway import (
    Drops,
    RakhshanHighwaySettings,
    Spacing,
    collision_share,
    collision_share_with_perfect_radio,
    collision_share_without_radio,
    draw,
    mean_and_error,
    reduction_and_error,
)
from sim_rig.studies.rakhshan.rakhshan_sensitivity_study import VARIANTS
from sim_rig.studies.rakhshan.slotted import (
    SlottedChannel,
    SlottedLinks,
    from_db,
    packet_success,
    slot_s,
    slots_needed,
)

SMALL = RakhshanSettings(drops=60, access=(0.002, 0.02, 0.1, 0.4))


def drops(settings: RakhshanHighwaySettings, count: int = 20) -> Drops:
    return draw(settings, count, np.random.default_rng(3))


def write(name: str, out_dir: Path, settings: Settings | None = None) -> None:
    find_study(name).write(out_dir, settings, Workers())


def read_table(folder: Path) -> list[dict[str, str]]:
    with (folder / "table.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_vectorised_sum_equals_the_formulas_lane_by_lane() -> None:
    settings = RakhshanHighwaySettings(lanes=2, cars_per_lane=6)
    one = drops(settings, 1)
    unsafe = one.unsafe[0]
    assert unsafe.any()
    assert not unsafe.all()
    access = np.where(unsafe, 0.2, 0.03)
    channel = SlottedChannel(from_db(11.0), 3.0)
    collisions = 0
    for lane in range(2):
        links = lane_links(6)
        in_all = SlottedLinks(links.sender + 6 * lane, links.receiver + 6 * lane)
        success = packet_success(one.position_m[0].ravel(), access.ravel(), in_all, channel)
        slots = slots_needed(success, access[lane][links.sender], access[lane][links.receiver])
        delay_s = reception_delay_s(slots, slot_s(9.0, 250), one.reaction_s[0, lane])
        begins_s = delay_s + one.reaction_s[0, lane]
        begins_s[0] = 0.0
        late = np.diff(begins_s) > one.lag_s[0, lane, 1:]
        collisions += int(late.sum())

    part = collision_share(settings, one, np.array([0.03]), np.array([0.2]))[0, 0, 0]

    assert part == collisions / 10


def test_with_equal_decelerations_the_tolerable_lag_is_the_headway() -> None:
    settings = RakhshanHighwaySettings(deceleration_low_m_s2=5.0, deceleration_high_m_s2=5.0)
    some = drops(settings)

    gap_m = np.diff(some.position_m, axis=-1) - settings.car_length_m

    assert some.lag_s[..., 1:] == pytest.approx(gap_m / settings.speed_m_s)


@pytest.mark.long
def test_the_crash_probability_is_the_share_of_drivers_without_radio_that_collide() -> None:
    """The probability integrates over decelerations; the drops draw them."""
    settings = RakhshanHighwaySettings()
    some = drops(settings, 2000)

    hits = some.reaction_s[..., 1:] > some.lag_s[..., 1:]

    probability = some.crash_probability[..., 1:]
    for low in (0.0, 0.2, 0.4, 0.6, 0.8):
        within = (probability >= low) & (probability < low + 0.2)
        standard_error = 0.5 / np.sqrt(within.sum())
        assert hits[within].mean() == pytest.approx(
            probability[within].mean(), abs=4 * standard_error
        )


def test_collisions_lie_between_those_of_a_perfect_radio_and_of_brake_lights() -> None:
    some = drops(RakhshanHighwaySettings(), 100)
    access = np.array([1e-9, 0.03])

    without_access, with_access = np.diagonal(
        collision_share(RakhshanHighwaySettings(), some, access, access)
    ).T

    assert np.array_equal(without_access, collision_share_without_radio(some))
    assert (
        collision_share_with_perfect_radio(some).mean()
        <= with_access.mean()
        < without_access.mean()
    )


def test_asynchronous_slots_cause_more_collisions() -> None:
    access = np.array([0.1])
    synchronous, asynchronous = (
        collision_share(settings, drops(settings, 100), access, access).mean()
        for settings in (RakhshanHighwaySettings(), RakhshanHighwaySettings(synchronous=False))
    )

    assert synchronous < asynchronous


@pytest.mark.parametrize("spacing", list(Spacing))
def test_gaps_have_their_mean(spacing: Spacing) -> None:
    settings = RakhshanHighwaySettings(spacing=spacing)
    gap_m = np.diff(drops(settings, 500).position_m, axis=-1) - settings.car_length_m

    assert gap_m.mean() == pytest.approx(settings.mean_gap_m, rel=0.03)
    assert gap_m.min() >= settings.least_gap_m - 1e-9


def test_the_interval_of_a_reduction_contains_the_true_value() -> None:
    rng = np.random.default_rng(5)
    inside = 0
    for _ in range(200):
        reference = rng.uniform(0.0, 1.0, 400)
        reduction, error = reduction_and_error(
            0.8 * reference + rng.normal(0.0, 0.1, 400), reference
        )
        inside += abs(reduction - 0.2) < error
    assert 180 <= inside <= 199


def test_without_collisions_there_is_nothing_to_reduce() -> None:
    assert reduction_and_error(np.array([0.0, 0.1]), np.zeros(2)) == (0.0, 0.0)


def test_mean_and_half_interval() -> None:
    mean, error = mean_and_error(np.array([[1.0, 2.0, 3.0]]))

    assert (mean[0], error[0]) == pytest.approx((2.0, 4.303 / np.sqrt(3)), rel=1e-4)


def test_figure_9_has_its_maximum_at_a_medium_access_probability(tmp_path: Path) -> None:
    write("rakhshan-figure9", tmp_path)

    table = read_table(tmp_path)
    far = [float(row["ssp_car_9"]) for row in table]
    assert max(far) > 10 * far[-1]
    assert max(far) > 2 * far[0]
    assert max(far) > max(float(row["sap_car_9"]) for row in table)


def test_figure_10_shows_hardly_a_gain_of_driver_based_access(tmp_path: Path) -> None:
    """The paper states 25 %. A radio without delay would not save two percent."""
    write("rakhshan-figure10", tmp_path, SMALL)

    assert len(read_table(tmp_path)) == len(SMALL.access) ** 2
    found = gain(SMALL, simulate(SMALL))
    assert found.perfect_radio < 0.02
    assert found.reduction - found.error <= found.perfect_radio


def test_figure_11_is_low_near_the_papers_optimum(tmp_path: Path) -> None:
    write("rakhshan-figure11", tmp_path, SMALL)

    table = read_table(tmp_path)
    least = min(table, key=lambda row: float(row["collision_probability"]))
    assert float(least["access"]) == 0.02
    assert (tmp_path / "figure.png").stat().st_size > 10_000
    settings = yaml.safe_load((tmp_path / "settings.yaml").read_text("utf-8"))
    assert settings["highway"]["threshold_db"] == 11.0


@pytest.mark.long
def test_the_same_seed_gives_the_same_table(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        write("rakhshan-figure11", tmp_path / folder, SMALL)

    assert read_table(tmp_path / "a") == read_table(tmp_path / "b")


def test_random_labels_keep_the_number_of_unsafe_cars() -> None:
    labelled, shuffled = simulate(SMALL), simulate(SMALL, shuffled=True)

    assert labelled.unsafe_share == shuffled.unsafe_share
    assert np.array_equal(labelled.without_radio, shuffled.without_radio)


def test_sensitivity_runs_every_variant_with_both_kinds_of_labels(tmp_path: Path) -> None:
    write("rakhshan-sensitivity", tmp_path, RakhshanSettings(drops=4, access=(0.01, 0.05)))

    assert len(read_table(tmp_path)) == 2 * len(VARIANTS)


def test_too_few_drivers_are_an_error() -> None:
    few = DriversSettings(drivers=40, reactions=10)
    observed = simulate_reactions(DEFAULT_POPULATION, few, np.random.default_rng(1))

    with pytest.raises(RuntimeError, match="more drivers"):
        fit_population(observed)


@pytest.mark.long
def test_the_fit_recovers_the_population(tmp_path: Path) -> None:
    write("rakhshan-figure6", tmp_path, DriversSettings(drivers=150, reactions=15))

    fitted = {row["parameter"]: float(row["fitted"]) for row in read_table(tmp_path)}
    assert fitted["beta_1"] == pytest.approx(DEFAULT_POPULATION.coefficients[0], abs=0.07)
    assert fitted["beta_log_headway"] == pytest.approx(0.25, abs=0.06)
    assert fitted["Sigma_11"] == pytest.approx(0.25**2, rel=0.4)
    assert fitted["sigma_squared"] == pytest.approx(0.25**2, rel=0.1)


@pytest.mark.long
def test_a_slow_drivers_estimate_moves_away_from_the_population(tmp_path: Path) -> None:
    write("rakhshan-figure7", tmp_path, DriversSettings(drivers=100))

    medians_s = {row["distribution"]: float(row["median_s"]) for row in read_table(tmp_path)}
    truth_s = medians_s["the driver"]
    estimate_s = medians_s["estimate, all uncertainty"]
    assert abs(estimate_s - truth_s) < 0.5 * abs(medians_s["population"] - truth_s)


@pytest.mark.parametrize(
    "name", [name for name in study_names() if name.startswith(("rakhshan-f", "rakhshan-t"))]
)
def test_every_study_can_be_found(name: str) -> None:
    assert find_study(name).name == name


def test_one_command_writes_a_figure(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["study", "rakhshan-figure9", "--out", str(tmp_path)])

    assert done.exit_code == 0
    assert "rakhshan-figure9: for the last car" in done.output
    written = {path.name for path in (tmp_path / "rakhshan-figure9").iterdir()}
    assert written == {"table.csv", "figure.png", "settings.yaml"}


def test_an_unknown_study_is_an_error_that_lists_the_studies() -> None:
    with pytest.raises(UserError, match="rakhshan-figure10"):
        find_study("rakhshan-figure99")
