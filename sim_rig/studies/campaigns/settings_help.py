"""The settings of a study as a YAML file with comments, for `sim-rig study NAME --help`.

It holds the defaults, so it is also a template for `--settings`.
"""

import ast
import inspect
import textwrap
from collections.abc import Iterator
from enum import Enum
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import yaml
from pydantic import BaseModel, TypeAdapter

_COLUMNS = 96


def settings_as_yaml(schema: type[BaseModel]) -> str:
    """Return all settings of `schema` with defaults and meaning; names end in their units."""
    return "\n".join(_lines(schema, "", None))


def _lines(schema: type[BaseModel], indent: str, given: BaseModel | None) -> Iterator[str]:
    """Yield the lines of one section, whose values are those of `given`, or else the defaults."""
    texts = meanings(schema)
    for name, field in schema.model_fields.items():
        allowed = ", ".join(map(str, _choices(field.annotation)))
        for text in (texts.get(name), allowed and f"Of: {allowed}"):
            yield from _comment(text or "", indent)
        value = (
            field.get_default(call_default_factory=True) if given is None else getattr(given, name)
        )
        if given is None and field.is_required():
            yield f"{indent}# {name}: is required"
        elif isinstance(value, BaseModel):
            yield f"{indent}{name}:"
            yield from _lines(type(value), indent + "  ", value)
        else:
            yield f"{indent}{name}: {_flow(value)}"


def _flow(value: object) -> str:
    tree = TypeAdapter(type(value)).dump_python(value, mode="json")
    return yaml.safe_dump(tree, default_flow_style=True, width=1000).removesuffix("...\n").strip()


def _comment(text: str, indent: str) -> list[str]:
    start = f"{indent}# "
    return textwrap.wrap(
        " ".join(text.split()), _COLUMNS, initial_indent=start, subsequent_indent=start
    )


def _choices(annotation: Any) -> list[object]:
    """Return the values that an annotation allows, if it lists them."""
    if get_origin(annotation) is Literal:
        return list(get_args(annotation))
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return [each.value for each in annotation]
    return [choice for part in get_args(annotation) for choice in _choices(part)]


def meanings(schema: type[BaseModel]) -> dict[str, str]:
    """Return the text below each field, in the sources of the class and of its bases."""
    texts: dict[str, str] = {}
    for each in reversed(schema.__mro__):
        if not issubclass(each, BaseModel) or not each.__annotations__ or each is BaseModel:
            continue
        body = _classes_in(inspect.getfile(each))[each.__name__].body
        for statement, below in pairwise(body):
            match statement, below:
                case (
                    ast.AnnAssign(target=ast.Name(id=name)),
                    ast.Expr(value=ast.Constant(value=str(text))),
                ):
                    texts[name] = text
                case _:
                    pass
    return texts


@cache
def _classes_in(file: str) -> dict[str, ast.ClassDef]:
    """Return the classes of a file: `inspect.getsource` would parse all of it for each."""
    tree = ast.parse(Path(file).read_text("utf-8"))
    return {node.name: node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)}
