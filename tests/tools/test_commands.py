"""What is asked often (help, completion, `check`) imports little: counted, since times vary."""

import os
import re
import subprocess
import sys
from inspect import getdoc
from itertools import takewhile

import pytest
import typer
from typer.testing import CliRunner

from onboard.tools.cli import app as onboard
from onboard.tools.commands import COMMANDS, imported
from onboard.tools.test_ca.cli import keys
from sim_rig.cli import app as sim_rig

SLOW = ("aiohttp", "can", "cantools", "cryptography", "cv2", "mcap", "numpy", "onnxruntime",
        "onboard.runtime", "onboard.vehicle.stack", "structlog")  # fmt: skip
"""They take a tenth of a second and more."""

PROGRAM = """
import sys
from onboard.tools.cli import main
sys.argv[0] = "onboard"
try:
    main()
finally:
    print(*sys.modules, file=sys.stderr)
"""


def modules_of(*arguments: str, **environment: str) -> set[str]:
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM, *arguments],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
        env=os.environ | environment,
    )
    return set(ended.stderr.split())


COMPLETION = {
    "_ONBOARD_COMPLETE": "complete_bash",
    "COMP_WORDS": "onboard che",
    "COMP_CWORD": "1",
}


@pytest.mark.parametrize(
    ("arguments", "environment", "most"),
    [
        (("--help",), {}, 400),
        (("--version",), {}, 250),
        ((), COMPLETION, 330),
        (("check", "examples/car.yaml"), {}, 420),
    ],
)
def test_it_imports_few_modules_and_none_that_is_slow(
    arguments: tuple[str, ...], environment: dict[str, str], most: int
) -> None:
    modules = modules_of(*arguments, **environment)

    assert [name for name in SLOW if name in modules] == []
    assert len(modules) <= most


@pytest.mark.parametrize("of", [onboard, sim_rig, keys])
def test_help_shortens_no_sentence_and_gives_a_switch_no_type(of: typer.Typer) -> None:
    shown = CliRunner().invoke(of, ["-h"], terminal_width=80).stdout

    assert "Commands:" in shown
    assert re.findall(r"<bool>|\w\.\.\.$", shown, re.MULTILINE) == []


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_is_listed_with_the_first_paragraph_of_its_help(name: str) -> None:
    command = imported(name)

    listed = takewhile(bool, (command.help or getdoc(command) or "").splitlines())
    assert " ".join(listed) == COMMANDS[name].help
