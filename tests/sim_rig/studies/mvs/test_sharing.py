"""Fig. 8 and Table I of the MVS paper, in small campaigns."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from onboard.errors import UserError
from onboard.mvs.settings import Selection
from onboard.tracking.evidence import Estimate, measurement_id
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.campaigns.catalogue import run_study
from sim_rig.studies.mvs import mvs_figure8_study, mvs_table1_study
from sim_rig.studies.mvs.mvs_table1_study import Table1Settings
from sim_rig.studies.mvs.scenes import SceneName
from sim_rig.studies.mvs.sharing import SharingSettings, random_until_all

SMALL = SharingSettings(
    seeds=1, scene=SceneName.OWN_CROSSING, shares=(0.1,), entries=(5,), warm_s=0.8, measured_s=0.2
)


def estimate(*stamps_ms: int) -> Estimate:
    provenance = frozenset(measurement_id(b"abcd", stamp_ms) for stamp_ms in stamps_ms)
    return Estimate(provenance, np.zeros(4), np.eye(4))


def test_random_selection_ends_as_soon_as_every_measurement_is_used() -> None:
    pieces = [estimate(1), estimate(1, 2, 3), estimate(2), estimate(3)]
    sizes = set()
    for seed in range(30):
        chosen = random_until_all(pieces, np.random.default_rng(seed))
        assert set().union(*(piece.provenance for piece in chosen)) == pieces[1].provenance
        sizes.add(len(chosen))

    assert sizes == {1, 2, 3}


@pytest.mark.long
def test_figure_8_is_written_with_its_settings(tmp_path: Path) -> None:
    path = tmp_path / "small.yaml"
    path.write_text(
        "seeds: 1\nscene: own-crossing\nshares: [0.1]\nentries: [5]\nwarm_s: 0.8\nmeasured_s: 0.2\n"
    )

    summary = run_study("mvs-figure8", tmp_path / "out", path, Workers())

    assert "of 1 cells" in summary
    with (tmp_path / "out/table.csv").open() as file:
        rows = {row["method"]: float(row["different_mes"]) for row in csv.DictReader(file)}
    assert rows["mvs"] >= max(rows["mo"], rows["rs"]) > 0.0
    assert (tmp_path / "out/figure.png").read_bytes().startswith(b"\x89PNG")
    assert "own-crossing" in (tmp_path / "out/settings.yaml").read_text()


def trace_of_one_car(folder: Path) -> Path:
    return trace(folder, {"ann": (0.0, 0.0)})


def trace_of_a_jam(folder: Path) -> Path:
    """Three lanes of eight cars, 20 m apart."""
    places = {f"c{lane}{at}": (20.0 * at, 4.0 * lane) for lane in range(3) for at in range(8)}
    return trace(folder, places)


def trace(folder: Path, places_m: dict[str, tuple[float, float]]) -> Path:
    """Ten seconds of cars that drive on at 10 m/s from their places."""
    path = folder / "trace.csv"
    rows = [
        f"{step / 10},{name},{x_m + step},{y_m},0,10"
        for step in range(100)
        for name, (x_m, y_m) in places_m.items()
    ]
    path.write_text("t,id,x,y,heading,v\n" + "\n".join(rows))
    return path


def test_a_recording_that_is_too_short_is_an_error(tmp_path: Path) -> None:
    settings = SMALL.model_copy(update={"scene": trace_of_one_car(tmp_path)})

    with pytest.raises(UserError, match=r"trace\.csv: ends after 9\.9 s, but .* need 241 s"):
        mvs_figure8_study.STUDY.write(tmp_path / "out", settings, Workers())


def test_a_cell_without_messages_is_not_counted_for_mvs(tmp_path: Path) -> None:
    one_car = {"scene": trace_of_one_car(tmp_path), "begin_s": (2.0, 4.0), "shares": (1.0,)}

    summary = mvs_figure8_study.STUDY.write(
        tmp_path / "out", SMALL.model_copy(update=one_car), Workers()
    )

    assert summary == "MVS delivers most in 0 of 1 cells (paper: in all)"


def test_table_1_with_a_users_setting_keeps_its_other_settings(tmp_path: Path) -> None:
    one_car = {"scene": str(trace_of_one_car(tmp_path)), "begin_s": [2.0, 4.0], "seeds": 1}

    run_study("mvs-table1", tmp_path / "out", None, Workers(), one_car | {"shares": [1.0]})

    assert len((tmp_path / "out/runs/runs.jsonl").read_text().splitlines()) == 1


@pytest.mark.long
def test_table_1_reuses_no_measurement(tmp_path: Path) -> None:
    jam = {"scene": trace_of_a_jam(tmp_path), "begin_s": (2.0, 4.0), "shares": (0.4,)}
    changes = jam | {"methods": (Selection.MVS,)}
    settings = Table1Settings.model_validate(SMALL.model_dump() | changes)

    summary = mvs_table1_study.STUDY.write(tmp_path, settings, Workers())

    assert summary.endswith("fused state: 0")
    stored = json.loads((tmp_path / "runs/runs.jsonl").read_text().splitlines()[0])
    row = mvs_table1_study.STUDY.row_of(stored, "runs.jsonl")
    assert row.reused_mvs == 0.0
    assert row.selected_rs >= row.selected_mvs >= 1.0
