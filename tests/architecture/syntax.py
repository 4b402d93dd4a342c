"""What the tests of this package read from the syntax trees of Python files, each parsed once."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
CHANGING = frozenset({
    "add", "append", "appendleft", "clear", "discard", "extend", "move_to_end", "pop", "popitem",
    "popleft", "put", "put_out", "remove", "setdefault", "update",
})  # fmt: skip
"""Methods that change what they belong to."""


class Function(NamedTuple):
    """One function or method."""

    name: str
    changes: bool
    """Whether it changes the object that it is a method of, or an element of anything."""


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
            Function(node.name, any(map(_changes, ast.walk(node))))
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


def _changes(node: ast.AST) -> bool:
    if isinstance(node, ast.Attribute | ast.Subscript):
        return isinstance(node.ctx, ast.Store | ast.Del)
    return (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr in CHANGING
        and _is_own(node.func.value)
    )


def _is_own(node: ast.expr) -> bool:
    """Whether it is an attribute of the object that a method belongs to, or of what it has."""
    while isinstance(node, ast.Attribute | ast.Subscript):
        node = node.value
    return isinstance(node, ast.Name) and node.id == "self"


def _named(node: ast.AST) -> Iterator[str]:
    match node:
        case ast.Name(id=name) | ast.Attribute(attr=name) | ast.arg(arg=name):
            yield name
        case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name):
            yield name
        case ast.ClassDef(name=name) | ast.keyword(arg=str(name)):
            yield name
