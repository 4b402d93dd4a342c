"""The commands of the pages: their names exist, so that a reader can type them."""

import re
import shlex
from itertools import takewhile
from pathlib import Path

import pytest
import typer

from onboard.tools.commands import COMMANDS as ONBOARD_COMMANDS
from onboard.tools.commands import imported
from sim_rig.cli import app as sim_rig
from sim_rig.scenario.catalogue import scenario_names
from sim_rig.studies.campaigns.catalogue import study_names
from tests.docs.test_pages import PAGES, ROOT, name_of
from tests.typed import a

COMMANDS = {
    "onboard": set(ONBOARD_COMMANDS),
    "sim-rig": set(a(typer.core.TyperGroup, typer.main.get_command(sim_rig)).commands),
}
TARGETS = set(re.findall(r"(?m)^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8")))
BENCHES = {path.stem for path in (ROOT / "bench").glob("*.py")}


def named(pattern: str, page: Path) -> set[str]:
    """Every word in what the group of `pattern` matches."""
    return {
        name for found in re.findall(pattern, page.read_text("utf-8")) for name in found.split()
    }


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_command_that_a_page_names_exists(page: Path) -> None:
    for program, commands in COMMANDS.items():
        assert named(rf"(?m)(?:\.venv/bin/|`|^    ){program} ([a-z]\w*)", page) <= commands
    assert named(r"sim-rig (?:run|ladder) (?:--virtual )?([a-z][\w-]*)", page) <= set(
        scenario_names()
    )
    assert named(r"sim-rig study ((?:[a-z][\w-]* ?)+)", page) <= set(study_names())
    assert named(r"(?m)(?:`|^    )make ([a-z-]+)", page) <= TARGETS
    assert named(r"python -m bench[ .]([a-z]\w*)", page) <= BENCHES


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_command_in_a_block_of_a_page_has_options_that_exist(page: Path) -> None:
    """Commands are parsed, not run; a wrong or missing option ends the parser with an error."""
    rig = a(typer.core.TyperGroup, typer.main.get_command(sim_rig)).commands
    pattern = r"(?m)^ {4}(?:\.venv/bin/)?(onboard|sim-rig) ([a-z].*)$"
    for program, line in re.findall(pattern, page.read_text("utf-8")):
        words = takewhile(
            lambda word: not re.match(r"[<>|&;]", word), shlex.split(line, comments=True)
        )
        name, *options = words
        command = imported(name) if program == "onboard" else rig[name]
        while isinstance(command, typer.core.TyperGroup):
            command = command.commands[options.pop(0)]
        command.make_context(name, options)
