"""What the tests of this package read from the syntax trees of Python files, each parsed once."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]


class Function(NamedTuple):
    """One function or method."""

    name: str
    assigns: bool
    """Whether it assigns to an attribute or an element."""


class Syntax(NamedTuple):
    """What one file imports, defines and names."""

    imports: tuple[str, ...]
    """Dotted names of modules, those imported inside functions as well."""
    classes: tuple[str, ...]
    """Those of the module's first level."""
    functions: tuple[Function, ...]
    names: frozenset[str]
    """All identifiers."""


def files_below(*trees: str) -> list[Path]:
    """Return the Python files below folders of the repository."""
    return [path for tree in trees for path in sorted((ROOT / tree).rglob("*.py"))]


@cache
def syntax_of(path: Path) -> Syntax:
    """Return what a file imports, defines and names."""
    tree = ast.parse(path.read_text("utf-8"))
    nodes = list(ast.walk(tree))
    return Syntax(
        imports=tuple(module for node in nodes for module in _imported(node)),
        classes=tuple(node.name for node in tree.body if isinstance(node, ast.ClassDef)),
        functions=tuple(
            Function(node.name, any(map(_assigns, ast.walk(node))))
            for node in nodes
            if isinstance(node, ast.FunctionDef)
        ),
        names=frozenset(name for node in nodes for name in _named(node)),
    )


def _imported(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom) and node.module is not None:
        if "." in node.module:
            yield node.module
        else:  # `from onboard import psid` imports a module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _assigns(node: ast.AST) -> bool:
    if isinstance(node, ast.Attribute | ast.Subscript):
        return isinstance(node.ctx, ast.Store | ast.Del)
    return False


def _named(node: ast.AST) -> Iterator[str]:
    match node:
        case ast.Name(id=name) | ast.Attribute(attr=name) | ast.arg(arg=name):
            yield name
        case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name):
            yield name
        case ast.ClassDef(name=name) | ast.keyword(arg=str(name)):
            yield name
