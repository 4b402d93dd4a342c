"""Settings in which a single value stands for a list of one."""

from collections.abc import Mapping
from typing import get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo


def with_lists_of_one(tree: object, schema: type[BaseModel]) -> object:
    """Return settings in which a single value is a list of one where several are allowed.

    A validator cannot do it: what follows one reads no JSON, in which a list may be a tuple.

    Args:
        tree: as it is given, right or not.
        schema: what it is to become.
    """
    if not isinstance(tree, Mapping):
        return tree
    return {name: _listed(value, schema.model_fields.get(name)) for name, value in tree.items()}


def _listed(given: object, field: FieldInfo | None) -> object:
    if field is None:
        return given
    inner = field.annotation
    if get_origin(inner) is tuple and get_args(inner)[-1] is Ellipsis:
        return given if isinstance(given, list | tuple) else [given]
    if isinstance(inner, type) and issubclass(inner, BaseModel):
        return with_lists_of_one(given, inner)
    return given
