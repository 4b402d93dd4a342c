"""The lines that programs send to the interface."""

from collections.abc import Collection
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from onboard.errors import DecodeError, first_mistake

MOST_KINDS = 64


class Subscribe(BaseModel):
    """From now on only events of these kinds are sent."""

    model_config = ConfigDict(strict=True, extra="forbid")

    kind: Literal["subscribe"]
    kinds: list[Annotated[str, Field(max_length=64)]] = Field(max_length=MOST_KINDS)


class BrakeButtonPress(BaseModel):
    """Press of the brake button."""

    model_config = ConfigDict(strict=True, extra="forbid")

    kind: Literal["brake_button"]


class ObjectList(BaseModel):
    """What a detector detects, in the format of its own port; its reader checks the rest."""

    model_config = ConfigDict(strict=True, extra="allow")

    kind: Literal["object_list"]


Request = Subscribe | BrakeButtonPress | ObjectList
_REQUEST: TypeAdapter[Request] = TypeAdapter(Annotated[Request, Field(discriminator="kind")])


def read_request(line: bytes, accepts: Collection[str]) -> Request:
    """Read a line.

    Args:
        line: as received.
        accepts: kinds that the configuration permits, beside `subscribe`.

    Raises:
        DecodeError: `malformed` or `not_permitted`.
    """
    try:
        request = _REQUEST.validate_json(line)
    except ValidationError as error:
        raise DecodeError("malformed", first_mistake(error)) from None
    if request.kind != "subscribe" and request.kind not in accepts:
        raise DecodeError("not_permitted", f"interface.accepts lacks {request.kind}")
    return request
