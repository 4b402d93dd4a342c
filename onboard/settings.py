"""Base class of all settings, and the YAML reader, whose errors tell a user what to correct.

Each package declares its settings beside its code; `onboard/config.py` joins those of a vehicle.
"""

import difflib
import json
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, SecretStr, ValidationError
from typing_extensions import override

from onboard.errors import UserError


class Settings(BaseModel):
    """Frozen and strict: an unknown key, a wrong type or an impossible value is an error."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", allow_inf_nan=False)


class SettingsError(UserError):
    """Names file, field, value and what is allowed, one line each."""


SettingsT = TypeVar("SettingsT", bound=Settings)


class _UniqueKeyLoader(yaml.SafeLoader):
    """Rejects repeated keys, of which PyYAML would use the last without an error."""

    @override
    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                raise yaml.MarkedYAMLError(
                    problem=f"key {key!r} is repeated", problem_mark=node.start_mark
                )
        return super().construct_mapping(node, deep)


def load_settings(path: Path, schema: type[SettingsT]) -> SettingsT:
    """Read the YAML file at `path` as a `schema`.

    Raises:
        SettingsError: the file is missing, not YAML, or does not fit; the message has one line
            per mistake.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read: {error.strerror}") from error
    tree = parse_yaml(data, str(path))
    return parse_settings(tree if tree is not None else {}, schema, str(path))


def parse_yaml(data: str | bytes, origin: str) -> object:
    """Parse a YAML text; `origin` names it in errors.

    Raises:
        SettingsError: it is not YAML or not UTF-8, or a key is repeated.
    """
    try:
        text = data if isinstance(data, str) else data.decode("utf-8")
        return yaml.load(text, _UniqueKeyLoader)  # noqa: S506 (a SafeLoader)
    except yaml.MarkedYAMLError as error:
        raise SettingsError(f"{origin}: not YAML: {_where(error)}{error.problem}") from error
    except (yaml.YAMLError, ValueError) as error:  # not UTF-8, or the 31st of February
        raise SettingsError(f"{origin}: not YAML: {' '.join(str(error).split())}") from error
    except RecursionError as error:
        raise SettingsError(f"{origin}: nested too deeply") from error


def _where(error: yaml.MarkedYAMLError) -> str:
    mark = error.problem_mark
    return f"line {mark.line + 1}, column {mark.column + 1}: " if mark is not None else ""


def parse_settings(tree: object, schema: type[SettingsT], origin: str) -> SettingsT:
    """Validate a parsed tree.

    Args:
        tree: what `parse_yaml` returns.
        schema: the settings to build.
        origin: name of the tree in errors.

    Raises:
        SettingsError: as in `load_settings`.
    """
    try:
        # JSON mode accepts a list for a tuple and a string for an enum, and is strict otherwise.
        text = json.dumps(tree, default=str)
    except (TypeError, ValueError) as error:  # a date for a key, a mapping within itself
        raise SettingsError(f"{origin}: {error}") from error
    try:
        return schema.model_validate_json(text)
    except ValidationError as error:
        lines = [_explain(dict(item), schema) for item in error.errors(include_url=False)]
        raise SettingsError("\n".join(f"{origin}: {line}" for line in lines)) from error


def _explain(error: dict[str, Any], schema: type[BaseModel]) -> str:
    # pydantic adds the names of a union's types, which mean nothing to a user.
    place = [str(part) for part in error["loc"] if "[" not in str(part)]
    field = ".".join(place) or "(the whole file)"
    if error["type"] == "missing":
        return f"{field}: is required and missing"
    if error["type"] == "extra_forbidden":
        return f"{field}: unknown key (given {error['input']!r}){_hint(error['loc'], schema)}"
    given, what = error["input"], error["msg"].removeprefix("Value error, ")
    is_secret = _is_secret(error["loc"], schema)
    if error["type"] == "string_type" and isinstance(given, bool | int | float):
        # YAML 1.1 reads NO as false and 0123 as 83.
        shown = "" if is_secret else f" (YAML understood {given!r})"
        return f"{field}: is a text, write it in quotes{shown}"
    if is_secret:
        least = error.get("ctx", {}).get("min_length")
        return f"{field}: {what if least is None else f'needs at least {least} characters'}"
    # Of a whole section only the keys, since a value may be secret.
    shown = ", ".join(map(str, given)) if isinstance(given, dict) else repr(given)
    return f"{field}: {what} (given {shown})"


def _hint(location: tuple[int | str, ...], schema: type[BaseModel]) -> str:
    """Return the keys allowed at `location`, and the most similar one."""
    model = _model_at(location[:-1], schema)
    if model is None:
        return ""
    allowed = list(model.model_fields)
    near = difflib.get_close_matches(str(location[-1]), allowed, n=1, cutoff=0.5)
    suggestion = f"; did you mean {near[0]}?" if near else ""
    return f"; allowed: {', '.join(sorted(allowed))}{suggestion}"


def _is_secret(location: tuple[int | str, ...], schema: type[BaseModel]) -> bool:
    """Return whether the value at `location` must not be logged."""
    model = _model_at(location[:-1], schema)
    field = model.model_fields.get(str(location[-1])) if model is not None and location else None
    annotation = field.annotation if field is not None else None
    return SecretStr in (annotation, *getattr(annotation, "__args__", ()))


def _model_at(location: tuple[int | str, ...], schema: type[BaseModel]) -> type[BaseModel] | None:
    model: type[BaseModel] = schema
    for part in location:
        if part in model.model_fields:
            inner = _model_in(model.model_fields[str(part)].annotation)
            if inner is None:
                return None
            model = inner
    return model


def _model_in(annotation: object) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        found = _model_in(argument)
        if found is not None:
            return found
    return None
