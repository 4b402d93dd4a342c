"""A request to brake as JSON, one UDP datagram each.

    {"deceleration_m_s2": 5.2, "certainty": 0.9, "valid_s": 0.3, "counter": 17, "causes": ["fcw"]}

The receiver counts `valid_s` from the arrival, on its own clock. A request with 0 m/s^2 ends the
one before.
"""

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from onboard.brake_request.brake_requester import COUNTER_END, BrakeRequest
from onboard.errors import DecodeError, first_mistake
from onboard.risk.alarm import Cause


class RequestDatagram(BaseModel):
    """The content; strict about types, but not about unknown keys."""

    model_config = ConfigDict(strict=True, frozen=True, allow_inf_nan=False)

    deceleration_m_s2: float = Field(ge=0.0, le=20.0)
    certainty: float = Field(ge=0.0, le=1.0)
    valid_s: float = Field(ge=0.0, le=1.0)
    counter: int = Field(ge=0, lt=COUNTER_END)
    causes: tuple[Cause, ...]


def encode(request: BrakeRequest) -> bytes:
    """Return the datagram."""
    return (
        RequestDatagram(
            deceleration_m_s2=round(request.deceleration_m_s2, 3),
            certainty=round(request.certainty, 3),
            valid_s=request.valid_s,
            counter=request.counter,
            causes=request.causes,
        )
        .model_dump_json()
        .encode()
    )


def decode(data: bytes) -> RequestDatagram:
    """Read a datagram.

    Raises:
        DecodeError: it is not a request.
    """
    try:
        return RequestDatagram.model_validate_json(data)
    except ValidationError as error:
        raise DecodeError("no_request", first_mistake(error)) from error
