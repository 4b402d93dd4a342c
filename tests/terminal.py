"""A command line in this process, as a user meets it: a start of Python takes two seconds."""

import sys
from collections.abc import Callable
from typing import NamedTuple

import pytest


class Ended(NamedTuple):
    """How a command ended."""

    returncode: int
    stdout: str
    stderr: str


class Terminal:
    """Runs one program."""

    def __init__(
        self,
        name: str,
        main: Callable[[], None],
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        self._name = name
        self._main = main
        self._monkeypatch = monkeypatch
        self._capsys = capsys
        monkeypatch.setenv("COLUMNS", "120")

    def run(self, *arguments: object) -> Ended:
        self._monkeypatch.setattr(sys, "argv", [self._name, *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            self._main()
        shown = self._capsys.readouterr()
        return Ended(int(end.value.code or 0), shown.out, shown.err)
