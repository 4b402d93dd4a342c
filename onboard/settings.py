"""Base class of all settings, and the YAML reader, whose errors tell a user what to correct.

Each package declares its settings beside its code; `onboard/vehicle/config.py` joins those of a
vehicle.
"""

import difflib
import json
from collections.abc import Hashable, Mapping
from itertools import chain
from pathlib import Path
from typing import Any, ClassVar, TypeVar, get_args

import yaml
from pydantic import BaseModel, ConfigDict, SecretStr, ValidationError
from typing_extensions import override

from onboard.errors import UserError


class Settings(BaseModel):
    """Frozen and strict: an unknown key, a wrong type or an impossible value is an error."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", allow_inf_nan=False)
    elsewhere: ClassVar[Mapping[str, str]] = {}
    """What a file is, and which command takes it, by a key that no file of these settings has."""


class SettingsError(UserError):
    """Names file, field, value and what is allowed, one line each."""


SettingsT = TypeVar("SettingsT", bound=Settings)
Location = tuple[int | str, ...]
"""Of a mistake, as pydantic gives it."""


MOST_ALIASED = 10_000
"""Values that the aliases of a file may stand for."""
MOST_MISTAKES = 20
"""Lines of an error, of which each names a mistake; more mistakes are counted."""

_MERGE = "tag:yaml.org,2002:merge"
_MOST_SHOWN = 200
"""Characters of a wrong value in an error."""
_BINARY_KINDS = {
    b"\x89PNG\r\n": "a PNG picture (onboard see)",
    b"\xff\xd8\xff": "a JPEG picture (onboard see)",
    b"\x89MCAP0\r\n": "an MCAP recording (onboard replay)",
    b"\xa1\xb2\xc3\xd4": "a pcap capture (onboard decode)",
    b"\xd4\xc3\xb2\xa1": "a pcap capture (onboard decode)",
    b"\x0a\x0d\x0d\x0a": "a pcapng capture (onboard decode)",
    b"LOGG": "a BLF log (onboard replay --can)",
    b"MDF ": "an MDF log (onboard replay --can)",
    b"\x1f\x8b": "compressed (gzip); unpack it",
    b"PK\x03\x04": "a ZIP archive; unpack it",
    b"%PDF": "a PDF document",
    b"\xff\xfe": "UTF-16 text; save it as UTF-8",
    b"\xfe\xff": "UTF-16 text; save it as UTF-8",
}
"""By the first bytes, with what takes such a file."""
_ISO_MEDIA = b"ftyp"
"""At byte 4 of MP4 and MOV (ISO 14496-12, 4.3)."""


class _Refused(yaml.MarkedYAMLError):
    """Valid YAML that is refused, since it hides a mistake."""


class _StrictLoader(yaml.SafeLoader):
    """Rejects repeated keys, of which PyYAML would use the last without an error, and empty ones.

    An empty `can:` may mean its defaults, or no such section. Aliases may stand for `MOST_ALIASED`
    values: nine lines of them could be a billion.
    """

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self._aliased = 0
        """Values that the aliases so far stand for."""

    @override
    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        is_alias = self.check_event(yaml.AliasEvent)
        mark = self.peek_event().start_mark if is_alias else None  # type: ignore[no-untyped-call]
        node = super().compose_node(parent, index)
        if is_alias and node is not None:
            nodes = [node]
            while nodes:
                self._aliased += 1
                if self._aliased > MOST_ALIASED:
                    raise _Refused(
                        problem=f"aliases stand for more than {MOST_ALIASED} values",
                        problem_mark=mark,
                    )
                value = nodes.pop().value
                nodes += chain.from_iterable(
                    each if isinstance(each, tuple) else (each,)
                    for each in (value if isinstance(value, list) else ())
                )
        return node

    @override
    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys: set[Any] = set()
        for key_node, value in node.value:
            if key_node.tag == _MERGE:
                raise _Refused(
                    problem=f"{key_node.value} is not known here: write its keys out",
                    problem_mark=key_node.start_mark,
                )
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, Hashable):  # PyYAML refuses another one
                if key in keys:
                    raise _Refused(problem=f"key {key!r} is repeated", problem_mark=node.start_mark)
                keys.add(key)
            if isinstance(value, yaml.ScalarNode) and value.value == "" and value.style is None:
                raise _Refused(
                    problem=f"{key} is empty: give it a value ({{}} for a section with its"
                    " defaults), or leave it out",
                    problem_mark=key_node.start_mark,
                )
        return super().construct_mapping(node, deep)


def load_settings(path: Path, schema: type[SettingsT]) -> SettingsT:
    """Read the YAML file at `path` as a `schema`.

    Raises:
        SettingsError: the file is missing, not YAML, or does not fit; the message has a line
            for each mistake, as far as `MOST_MISTAKES`.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read: {error.strerror}") from error
    tree = parse_yaml(data, str(path))
    for key in tree if isinstance(tree, dict) else ():
        if key in schema.elsewhere:
            raise SettingsError(f"{path}: {schema.elsewhere[key]} {path}")
    return parse_settings(tree if tree is not None else {}, schema, str(path))


def parse_yaml(data: str | bytes, origin: str) -> object:
    """Parse a YAML text; `origin` names it in errors.

    Raises:
        SettingsError: it is not YAML or not UTF-8, or a key is repeated or empty.
    """
    try:
        text = data if isinstance(data, str) else data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise SettingsError(f"{origin}: not YAML: {_explain_no_text(error)}") from error
    try:
        return yaml.load(text, _StrictLoader)  # noqa: S506 (a SafeLoader)
    except yaml.MarkedYAMLError as error:
        raise SettingsError(f"{origin}: {_describe(error)}") from error
    except (yaml.YAMLError, ValueError) as error:  # the 31st of February
        raise SettingsError(f"{origin}: not YAML: {' '.join(str(error).split())}") from error
    except RecursionError as error:
        raise SettingsError(f"{origin}: nested too deeply") from error


def _explain_no_text(error: UnicodeDecodeError) -> str:
    """Say what a file is whose content could not be decoded as UTF-8, or where it is not."""
    data = error.object
    kind = next((kind for start, kind in _BINARY_KINDS.items() if data.startswith(start)), None)
    if kind is None and data[4:8] == _ISO_MEDIA:
        kind = "a video (onboard see)"
    if kind is not None:
        return f"it is {kind}"
    line = data.count(b"\n", 0, error.start) + 1
    return f"line {line} is not UTF-8 (byte 0x{data[error.start]:02x}); save it as UTF-8"


def _describe(error: yaml.MarkedYAMLError) -> str:
    """Say where and what the mistake is; for the commonest ones PyYAML names where it noticed."""
    mark, problem = error.problem_mark, error.problem
    if error.context == "while scanning a quoted scalar":
        mark, problem = error.context_mark, "this quote is not closed"
    elif error.context == "while scanning a simple key":
        mark, problem = error.context_mark, "a key needs a colon and a space after it"
    where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark is not None else ""
    return f"{where}{problem}" if isinstance(error, _Refused) else f"not YAML: {where}{problem}"


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
        text = json.dumps(tree, default=str, ensure_ascii=False).encode()
    except (TypeError, ValueError) as error:
        # A date for a key, a mapping within itself, half of a surrogate pair.
        raise SettingsError(f"{origin}: {error}") from error
    try:
        return schema.model_validate_json(text)
    except ValidationError as error:
        items = error.errors(include_url=False)
        if items[0]["type"] == "json_invalid":  # its input is the whole file, with the secrets
            raise SettingsError(f"{origin}: nested too deeply") from error
        lines = [_explain(dict(item), schema) for item in items[:MOST_MISTAKES]]
        if len(items) > MOST_MISTAKES:
            lines.append(f"more mistakes: {len(items) - MOST_MISTAKES}")
        raise SettingsError("\n".join(f"{origin}: {line}" for line in lines)) from error


def _explain(error: dict[str, Any], schema: type[BaseModel]) -> str:
    field = ".".join(_walk(error["loc"], schema)[0])
    if error["type"].startswith("union_tag"):
        return f"{field}.{_explain_tag(error, schema)}"
    field = field or "(the whole file)"
    if error["type"] == "missing":
        return f"{field}: is required and missing"
    given, what = error["input"], error["msg"].removeprefix("Value error, ")
    if error["type"] == "extra_forbidden":
        return (
            f"{field}: unknown key (given {_shortened(repr(given))}){_hint(error['loc'], schema)}"
        )
    if error["type"] in {"model_type", "dict_type"}:
        what = "needs a line `key: value` for each of its settings"
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
    return f"{field}: {what} (given {_shortened(shown)})"


def _shortened(text: str) -> str:
    """Return the start of a long text: a log that is read as a setting is one."""
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}..."


def _explain_tag(error: dict[str, Any], schema: type[BaseModel]) -> str:
    """Explain a missing or unknown value of the key that chooses the kind of a section."""
    context = error["ctx"]
    key = _unquoted(context["discriminator"])
    if "tag" not in context:
        kinds = _walk(error["loc"], schema)[1]
        tags = sorted(tag for kind in kinds for tag in get_args(kind.model_fields[key].annotation))
        return f"{key}: is required and missing; allowed: {', '.join(tags)}"
    allowed, given = context["expected_tags"], context["tag"]
    near = _near(given, [_unquoted(each) for each in allowed.split(", ")])
    return f"{key}: Input should be one of {allowed} (given {given!r}){near}"


def _unquoted(text: str) -> str:
    return text.strip("'")


def _near(given: str, allowed: list[str]) -> str:
    """Return a suggestion, if one of `allowed` is similar."""
    near = difflib.get_close_matches(given, allowed, cutoff=0.5)
    best = sorted(near, key=lambda name: not name.startswith(given))
    return f"; did you mean {best[0]}?" if best else ""


def _hint(location: Location, schema: type[BaseModel]) -> str:
    """Return the keys allowed at `location`, and the most similar one."""
    model = _model_at(location[:-1], schema)
    if model is None:
        return ""
    allowed = sorted(model.model_fields)
    return f"; allowed: {', '.join(allowed)}{_near(str(location[-1]), allowed)}"


def _is_secret(location: Location, schema: type[BaseModel]) -> bool:
    """Return whether the value at `location` must not be logged."""
    model = _model_at(location[:-1], schema)
    field = model.model_fields.get(str(location[-1])) if model is not None and location else None
    annotation = field.annotation if field is not None else None
    return SecretStr in (annotation, *getattr(annotation, "__args__", ()))


def _model_at(location: Location, schema: type[BaseModel]) -> type[BaseModel] | None:
    models = _walk(location, schema)[1]
    return models[0] if models else None


def _walk(location: Location, schema: type[BaseModel]) -> tuple[list[str], list[type[BaseModel]]]:
    """Return the parts of `location` that are in the file, and the models that may be there.

    pydantic adds the names of a union's types, or the value that chose one of them.
    """
    keys: list[str] = []
    models = [schema]
    for part in location:
        chosen = [model for model in models if _is_tag(part, model)]
        if "[" in str(part):
            continue
        if len(models) > 1 and chosen:
            models = chosen
            continue
        keys.append(str(part))
        for model in models:
            if part in model.model_fields:
                models = _models_in(model.model_fields[str(part)].annotation)
                break
    return keys, models


def _is_tag(part: int | str, model: type[BaseModel]) -> bool:
    return any(part in get_args(field.annotation) for field in model.model_fields.values())


def _models_in(annotation: object) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for argument in get_args(annotation) for model in _models_in(argument)]
