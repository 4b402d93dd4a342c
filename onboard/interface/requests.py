"""The lines that programs send to the interface."""

from collections.abc import Collection
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from onboard.errors import DecodeError, first_mistake

MOST_KINDS = 64
MOST_BYTES = 1000
"""Of a message: with certificate and signature it fits into a frame."""
MOST_URGENT = 2
"""User priority of a message: the vehicle's own go first, of which CAMs have 3."""


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


class MessageRequest(BaseModel):
    """A message to sign and send."""

    model_config = ConfigDict(strict=True, extra="forbid")

    kind: Literal["message"]
    psid: int
    user_priority: int = Field(1, ge=0, le=MOST_URGENT)
    data: str = Field(max_length=2 * MOST_BYTES, pattern="^([0-9a-fA-F]{2})+$")
    """In hexadecimal, as it is signed."""


Request = Subscribe | BrakeButtonPress | ObjectList | MessageRequest
_REQUEST: TypeAdapter[Request] = TypeAdapter(Annotated[Request, Field(discriminator="kind")])


def read_request(line: bytes, accepts: Collection[str], sends: Collection[int] = ()) -> Request:
    """Read a line.

    Args:
        line: as received.
        accepts: kinds that the configuration permits, beside `subscribe`.
        sends: services of whose messages it permits to send.

    Raises:
        DecodeError: `malformed` or `not_permitted`.
    """
    try:
        request = _REQUEST.validate_json(line)
    except ValidationError as error:
        raise DecodeError("malformed", first_mistake(error)) from None
    if isinstance(request, MessageRequest):
        if request.psid not in sends:
            raise DecodeError("not_permitted", f"interface.sends lacks psid 0x{request.psid:X}")
    elif request.kind != "subscribe" and request.kind not in accepts:
        raise DecodeError("not_permitted", f"interface.accepts lacks {request.kind}")
    return request
