"""Imports of the repository's Python files."""

from typing import NamedTuple

from tests.architecture.syntax import ROOT, files_below, syntax_of


class Import(NamedTuple):
    """One imported module, and the file that imports it."""

    importer: str
    """Path below the root."""
    module: str
    """Dotted name."""


def imports_of(tree: str) -> list[Import]:
    """Return all imports of the files below a folder, those inside functions as well."""
    return [
        Import(str(path.relative_to(ROOT)), module)
        for path in files_below(tree)
        for module in syntax_of(path).imports
    ]
