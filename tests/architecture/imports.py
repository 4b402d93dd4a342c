"""Imports of the repository's Python files, read from their syntax trees."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]


class Import(NamedTuple):
    """One imported module, and the file that imports it."""

    importer: str
    """Path below the root."""
    module: str
    """Dotted name."""


@cache
def imports_of(tree: str) -> tuple[Import, ...]:
    """Return all imports of the files below a folder, those inside functions as well."""
    return tuple(
        Import(str(path.relative_to(ROOT)), module)
        for path in sorted((ROOT / tree).rglob("*.py"))
        for module in _modules(ast.parse(path.read_text("utf-8")))
    )


def _modules(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            if "." in node.module:
                yield node.module
            else:  # `from onboard import psid` imports a module
                yield from (f"{node.module}.{alias.name}" for alias in node.names)
