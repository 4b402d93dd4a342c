"""What the tests of this package read from the syntax trees of Python files, each parsed once."""

import ast
import re
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
CHANGING = frozenset({
    "add", "append", "appendleft", "clear", "discard", "extend", "move_to_end", "pop", "popitem",
    "popleft", "put", "put_out", "remove", "setdefault", "update",
})  # fmt: skip
"""Methods that change what they belong to."""
QUESTION = re.compile(r"_?(is|has|can|may|permits)(_|$)")
NAME_IN: Mapping[type[ast.AST], str] = {
    ast.Name: "id",
    ast.Attribute: "attr",
    ast.arg: "arg",
    ast.FunctionDef: "name",
    ast.AsyncFunctionDef: "name",
    ast.ClassDef: "name",
    ast.keyword: "arg",
}
"""Attribute with an identifier, by kind of node."""


class Syntax(NamedTuple):
    """What one file imports, defines and names."""

    imports: tuple[str, ...]
    """Dotted names of modules, those imported inside functions as well."""
    classes: tuple[str, ...]
    """Those of the module's first level."""
    functions: frozenset[str]
    """Names of functions and methods."""
    changing_questions: tuple[str, ...]
    """Those named as a question which change what they are a method of, or an element of anything.
    """
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
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    named = {getattr(node, NAME_IN[type(node)]) for node in nodes if type(node) in NAME_IN}
    return Syntax(
        imports=tuple(module for node in nodes for module in _imported(node)),
        classes=tuple(node.name for node in tree.body if isinstance(node, ast.ClassDef)),
        functions=frozenset(each.name for each in functions),
        changing_questions=tuple(
            each.name
            for each in functions
            if QUESTION.match(each.name) and any(map(_changes, ast.walk(each)))
        ),
        names=frozenset(named - {None}),
    )


def _imported(node: ast.AST) -> Sequence[str]:
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom) and node.module is not None:
        if "." in node.module:
            return [node.module]
        # `from onboard import psid` imports a module
        return [f"{node.module}.{alias.name}" for alias in node.names]
    return ()


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
