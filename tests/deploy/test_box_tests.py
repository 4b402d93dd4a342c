"""The table of what the targets that test a box have measured."""

import re
from pathlib import Path

from deploy.box_tests import TARGETS, BoxFigure, read_figures, record
from deploy.vm.drive import StatusRow
from deploy.vm.report import figures

MAKEFILE = Path(__file__).parents[2] / "Makefile"


def test_a_target_replaces_its_own_rows_only_and_rows_are_in_the_order_of_the_targets(
    tmp_path: Path,
) -> None:
    table = tmp_path / "table.csv"
    record("vm-test", "old", [BoxFigure("stop", "0.46", "s", "2.00")], table)
    record("hil-test", "old", [BoxFigure("box: outcome", "PASSED", "", "PASSED")] * 2, table)
    record("hil-test", "new", [BoxFigure("box: chain, p50", "7.5", "ms", "")], table)
    assert table.read_text().splitlines() == [
        "target,build,figure,value,unit,limit",
        'hil-test,new,"box: chain, p50",7.5,ms,',
        "vm-test,old,stop,0.46,s,2.00",
    ]


def test_the_file_of_a_ladder_is_read(tmp_path: Path) -> None:
    (tmp_path / "ladder.csv").write_text("figure,value,unit,limit\nbox: outcome,PASSED,,PASSED\n")
    assert read_figures(tmp_path / "ladder.csv") == [
        BoxFigure("box: outcome", "PASSED", "", "PASSED")
    ]


def test_a_fault_has_a_figure_of_its_detection_and_one_with_its_limit() -> None:
    rows = [
        StatusRow("bus down", 0.071, 0.59, 3.0),
        StatusRow("recording opened", None, None, None, "32 CAN frames in it"),
    ]
    assert list(figures(rows)) == [
        BoxFigure("bus down: detected", "0.071", "s", ""),
        BoxFigure("bus down", "0.59", "s", "3.00"),
        BoxFigure("recording opened", "32 CAN frames in it", "", ""),
    ]


def test_every_target_is_one_of_the_makefile() -> None:
    made = re.findall(r"(?m)^([a-z-]+):", MAKEFILE.read_text("utf-8"))
    assert set(TARGETS) <= set(made)
