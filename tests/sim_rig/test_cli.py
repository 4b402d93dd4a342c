"""The commands of the rig, as a user meets them."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from onboard.recorder.build import present_build
from sim_rig.cli import main
from sim_rig.scenario.catalogue import scenario_names, scenario_titles
from sim_rig.scenario.schema import load_scenario
from tests.terminal import Terminal


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Terminal:
    return Terminal("sim-rig", main, monkeypatch, capsys)


def test_the_module_runs_as_a_program() -> None:
    run = subprocess.run(
        [sys.executable, "-m", "sim_rig", "list"],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )

    assert [line.split()[0] for line in run.stdout.splitlines()] == scenario_names()


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("sim-rig run shared", ["shared-detection", "shared-sdsm"]),
        ("sim-rig study mvs-figure", ["mvs-figure3", "mvs-figure8", "mvs-figure9"]),
    ],
)
def test_the_shell_completes_scenarios_and_studies(words: str, offered: list[str]) -> None:
    asked = {"_SIM_RIG_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": "2"}
    code = "import sys; sys.argv[0] = 'sim-rig'; from sim_rig.cli import main; main()"

    run = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env=os.environ | asked,
        check=False,
    )

    assert run.stdout.split() == offered


def without(modules: tuple[str, ...], *arguments: str) -> subprocess.CompletedProcess[str]:
    """The command line where `modules` are not installed."""
    missing = dict.fromkeys(modules)
    code = f"import sys; sys.modules |= {missing}; from sim_rig.cli import main; main()"
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.mark.parametrize("command", ["--help", "list"])
def test_help_and_list_need_no_large_package(command: str) -> None:
    large = ("numpy", "scipy", "cv2", "matplotlib", "PIL", "av", "cantools")
    shown = without(large, command)
    assert (shown.returncode, shown.stderr) == (0, "")
    assert shown.stdout


@pytest.mark.long
@pytest.mark.parametrize(
    ("package", "extra", "command"),
    [
        ("PIL", "rig", ("run", "fig4", "--virtual")),
        ("matplotlib", "rig", ("run", "fig4", "--virtual")),
        ("statsmodels", "studies", ("study", "rakhshan-figure6")),
        ("scipy", "studies", ("study", "crossing-alarms")),
    ],
)
def test_a_package_of_the_extra_that_is_missing_is_one_line(
    tmp_path: Path, package: str, extra: str, command: tuple[str, ...]
) -> None:
    run = without((package,), *command, "--out", str(tmp_path))
    assert run.returncode == 2
    how = f"pip install 'onboard[{extra}]' (in a clone: make .venv/ready)"
    assert run.stderr == f"sim-rig needs {package}: {how}\n"


@pytest.mark.long
def test_a_study_of_sumos_traffic_without_sumo_ends_with_one_line(tmp_path: Path) -> None:
    grid = ("study", "mvs-figure8", "--scene", "sumo-grid", "--workers", "1")
    run = without(("libsumo",), *grid, "--out", str(tmp_path))
    assert run.returncode == 2
    assert run.stderr.startswith("sim-rig needs libsumo: pip install 'onboard[sumo]' (in a clone")


def test_the_version_names_commit_and_date(terminal: Terminal) -> None:
    assert terminal.run("--version") == (0, f"onboard {present_build().name}\n", "")


def test_a_misspelt_scenario_names_the_nearest(terminal: Terminal) -> None:
    code, _, complaint = terminal.run("run", "platon")
    assert (code, complaint) == (2, "platon: no such scenario or file; did you mean platoon?\n")


def test_titles_are_those_of_the_schema() -> None:
    assert scenario_titles() == {name: load_scenario(name).title for name in scenario_names()}


@pytest.mark.long
def test_a_virtual_run_prints_a_report_writes_traces_and_is_shown_from_above(
    terminal: Terminal, tmp_path: Path
) -> None:
    code, shown, _ = terminal.run(
        "run", "--virtual", "fig4", "--seed", "11", "--out", str(tmp_path)
    )

    assert code == 0
    for part in ("Timeline", "WARNED: green brakes", "not_in_group", "Latency ledger", "PASSED"):
        assert part in shown
    lines = (tmp_path / "fig4-virtual" / "red.jsonl").read_text().splitlines()
    assert {"speed", "plate", "lead", "warning"} <= {json.loads(line)["kind"] for line in lines}

    code, shown, _ = terminal.run("show", str(tmp_path / "fig4-virtual"))

    page = tmp_path / "fig4-virtual" / "run.html"
    assert (code, page.is_file()) == (0, True)
    assert shown.endswith(f"in {page}\n")


@pytest.fixture
def impossible(tmp_path: Path) -> Path:
    """Nobody brakes, and yet somebody is to be warned."""
    path = tmp_path / "impossible.yaml"
    path.write_text(
        """
title: A car is expected to be warned although no car brakes.
seed: 1
duration_s: 2
radio: {reach_m: 100}
cars: {ann: {plate: A1B2, lane: 1, start_m: 0, speed_m_s: 5}}
expect: [{what: warning, braking: ann, at_s: [0], within_s: {ann: 1}}]
"""
    )
    return path


def test_a_run_that_does_not_come_as_expected_fails_with_1(
    terminal: Terminal, impossible: Path
) -> None:
    out = str(impossible.parent / "out")
    code, shown, _ = terminal.run("run", "--virtual", str(impossible), "--out", out)

    assert code == 1
    assert "FAILED ann is not warned of ann braking at 0 s" in shown
    assert "Latency ledger" not in shown, "a table without a row says nothing"


def test_an_output_folder_that_cannot_be_made_is_the_users_mistake(
    terminal: Terminal, impossible: Path
) -> None:
    code, _, complaint = terminal.run(
        "run", "--virtual", str(impossible), "--out", str(impossible / "out")
    )

    assert code == 2
    assert "cannot be written: Not a directory" in complaint


@pytest.mark.parametrize("arguments", [("run", "fig5"), ("run",), ("jump",)])
def test_a_mistake_of_the_user_ends_with_2(terminal: Terminal, arguments: tuple[str, ...]) -> None:
    code, shown, complaint = terminal.run(*arguments)

    assert (code, shown) == (2, "")
    assert complaint


@pytest.mark.long
def test_a_run_in_virtual_time_that_is_to_be_watched_opens_from_above(tmp_path: Path) -> None:
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" > {tmp_path}/opened\n', encoding="utf-8")
    browser.chmod(0o755)

    subprocess.run(
        [sys.executable, "-m", "sim_rig", "run", "left-turn", "--virtual", "--watch"],
        cwd=tmp_path,
        env={**os.environ, "BROWSER": str(browser), "PYTHONPATH": str(Path.cwd())},
        timeout=120,
        check=True,
        capture_output=True,
    )

    page = tmp_path / "out" / "left-turn-virtual" / "run.html"
    assert page.is_file()
    assert (tmp_path / "opened").read_text(encoding="utf-8").strip() == page.as_uri()
