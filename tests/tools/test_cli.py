"""The command line: a mistake of the user is one line and exit code 2, without a traceback."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from onboard.recorder.build import present_build
from onboard.tools.cli import main
from tests.terminal import Terminal


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Terminal:
    return Terminal("onboard", main, monkeypatch, capsys)


def test_the_version_names_commit_and_date(terminal: Terminal) -> None:
    assert terminal.run("--version").stdout == f"onboard {present_build().name}\n"


def test_a_mistake_ends_the_program_with_one_line(tmp_path: Path) -> None:
    """In a process of its own."""
    ended = subprocess.run(
        [sys.executable, "-m", "onboard", "check", str(tmp_path / "car.yaml")],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )

    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr == f"{tmp_path / 'car.yaml'}: cannot be read: No such file or directory\n"


def test_output_on_a_full_disk_is_one_line() -> None:
    """In a process of its own, as what is left is written when it ends."""
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(
            [sys.executable, "-m", "onboard", "check", "examples/desk.yaml"],
            cwd=Path(__file__).parents[2],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            timeout=60,
        )

    assert ended.stderr == "the output cannot be written: No space left on device\n"
    assert ended.returncode == 2


def test_check_lists_the_sections_of_a_valid_configuration(
    terminal: Terminal, tmp_path: Path
) -> None:
    config = tmp_path / "car.yaml"
    config.write_text("car: {plate: ABC1234}\ngnss: {}\nhmi: {port: 8460}\n")

    result = terminal.run("check", str(config))

    assert result.returncode == 0
    assert result.stdout == (
        f"{config}: good, car ABC1234\n"
        "  with gnss, hmi\n"
        "  without can, camera, detector, radio, brake_request, recorder\n"
    )


@pytest.mark.long
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("car: {plate: abc 1}", "upper case letters and digits, without separators, as ABC1 (giv"),
        ("car: {plate: A1}\ncan:", "line 2, column 1: can is empty: give it a value"),
        ("car: {plate: A1}\nradio: {endpoint: rsu41}", "yaml: radio.listen_port: is required"),
        (
            "car: {plate: A1}\ncamera: {source: '0', focal_x_px: 18}",
            "focal_x_px is 18, but must be at least 0.25 of width_px, which is 1280",
        ),
        ("car: {plate: A1}\nobd: {poling_hz: 3}", "did you mean polling_hz?"),
        ("car: {plate: A1}\ncamera: {source: '0', focal_x: 18}", "did you mean focal_x_px?"),
        ("car: {plate: A1}\nlcca: {join_headway_s: -1}", "lcca.join_headway_s: Input should be gr"),
        (
            "car: {plate: A1}\ncan: {interface: elm327}",
            "can.interface: Input should be 'socketcan'",
        ),
    ],
)
def test_a_mistake_in_the_configuration_is_one_line(
    terminal: Terminal, tmp_path: Path, text: str, message: str
) -> None:
    config = tmp_path / "car.yaml"
    config.write_text(text)

    result = terminal.run("check", str(config))

    assert result.returncode == 2
    assert message in result.stderr
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.long
@pytest.mark.parametrize(
    ("dbc", "message"),
    [
        (None, "cannot be read: No such file"),
        ("VERSION", "no DBC file"),
        ("BU_:\n", "no message A"),
    ],
)
def test_a_mistake_in_the_dbc_file_is_one_line(
    terminal: Terminal, tmp_path: Path, dbc: str | None, message: str
) -> None:
    config = tmp_path / "car.yaml"
    config.write_text(
        f"car: {{plate: A1}}\nobd: {{broadcast: {{dbc: {tmp_path}/a.dbc, speed: [A.B]}}}}\n"
    )
    if dbc is not None:
        (tmp_path / "a.dbc").write_text(dbc)

    result = terminal.run("check", str(config))

    assert result.returncode == 2
    assert f"{tmp_path}/a.dbc: {message}" in result.stderr
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.long
@pytest.mark.parametrize(
    "section",
    [
        "can: {interface: socketcand, port: 1}",
        "can: {interface: socketcan, channel: nosuchcan9}",
        "camera: {source: /nonexistent/clip.mp4}",
        "radio: {endpoint: raw, interface: nosuchwlan9}",
        "security: {keys_folder: /nonexistent}",
    ],
)
def test_an_edge_that_cannot_be_opened_is_one_line(tmp_path: Path, section: str) -> None:
    config = tmp_path / "car.yaml"
    config.write_text(f"car: {{plate: A1}}\n{section}\n")

    result = subprocess.run(
        [sys.executable, "-m", "onboard", "run", str(config)],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )

    assert result.returncode == 2
    assert len(result.stderr.splitlines()) == 1, result.stderr


def test_a_can_log_without_speeds_says_what_to_configure(
    terminal: Terminal, tmp_path: Path
) -> None:
    log = tmp_path / "a.log"
    log.write_text("(1.0) can0 123#0102\n(3.0) can0 123#0102\n", encoding="ascii")

    result = terminal.run("replay", "--can", str(log))

    assert result.returncode == 0
    assert result.stderr.startswith(f"{log}: holds no answer of OBD-II")
    assert "obd.broadcast" in result.stderr


def test_replay_prints_one_json_object_a_line(terminal: Terminal, tmp_path: Path) -> None:
    log = tmp_path / "drive.log"
    log.write_text(
        "(100.000000) can0 7E8#03410D3C00000000\n"
        "(100.050000) can0 7E8#03410D3D00000000\n"
        "(100.100000) can0 123#DEADBEEF\n"
    )

    result = terminal.run("replay", "--can", str(log))

    assert result.returncode == 0, result.stderr
    lines = [json.loads(line) for line in result.stdout.splitlines()]
    assert [line["stamp_s"] for line in lines] == [100.0, 100.05]
    assert [line["kind"] for line in lines] == ["speed", "speed"]
    assert lines[0]["speed_m_s"] == pytest.approx(60 / 3.6)


def test_a_missing_log_is_reported_as_missing(terminal: Terminal) -> None:
    result = terminal.run("replay", "--can", "/nonexistent")

    assert result.returncode == 2
    assert result.stderr == "/nonexistent: no such file\n"
