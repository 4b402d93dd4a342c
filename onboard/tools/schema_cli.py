"""`onboard schema`: the JSON schema of the lines of the trace and of the live interface."""

import json
from dataclasses import fields
from typing import Any, get_type_hints

import typer
from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import core_schema
from typing_extensions import override

from onboard.access.adaptation import FollowingSafety, ReactionObserved
from onboard.brake_request.brake_requester import BrakeRequest
from onboard.interface.event_server import VERSION
from onboard.intersections.intersections import SignalAhead
from onboard.its_g5.congestion_control import ChannelLoad
from onboard.lcca.events import (
    Identified,
    IdentityLost,
    Inquired,
    Transition,
    WarningLevel,
    WarningOver,
    WarningRaised,
)
from onboard.messages.exchanged import MessageReceived, MessageSent
from onboard.misbehaviour.signer_credibility import SignerIgnored
from onboard.observations import (
    BrakePedal,
    Curvature,
    DetectionList,
    Discarded,
    HardBrake,
    Lead,
    Plate,
    Position,
    SensorImpaired,
    SensorLost,
    SensorRecovered,
    Speed,
    Steering,
    TurnSignal,
    VehicleDetection,
    YawRate,
)
from onboard.recorder.records import RecorderState
from onboard.risk.alarm import Alarm
from onboard.runtime.daemon import Ready
from onboard.security.pseudonyms import CertificateExpired
from onboard.trace.file_failure import FileFailure
from onboard.trace.trace_line import Event, traced_fields
from onboard.tracking.perceived_object import PerceivedObject

TRACED: tuple[type[Event], ...] = (
    Alarm, BrakePedal, BrakeRequest, CertificateExpired, ChannelLoad, Curvature, DetectionList,
    Discarded, FileFailure, FollowingSafety, HardBrake, Identified, IdentityLost, Inquired, Lead,
    MessageReceived, MessageSent, PerceivedObject, Plate, Position, ReactionObserved, Ready,
    RecorderState, SensorImpaired, SensorLost, SensorRecovered, SignalAhead, SignerIgnored, Speed,
    Steering, Transition, TurnSignal, VehicleDetection, WarningLevel, WarningOver, WarningRaised,
    YawRate,
)  # fmt: skip
"""The events of a trace."""


class _TraceSchema(GenerateJsonSchema):
    """Bytes are hexadecimal, and numbers that are not finite are strings."""

    @override
    def bytes_schema(self, schema: core_schema.BytesSchema) -> dict[str, Any]:
        return {"type": "string", "pattern": "^([0-9a-f]{2})*$"}

    @override
    def float_schema(self, schema: core_schema.FloatSchema) -> dict[str, Any]:
        return {"anyOf": [{"type": "number"}, {"enum": ["inf", "-inf", "nan"]}]}


def schema_of(events: tuple[type[Event], ...] = TRACED) -> dict[str, Any]:
    """Return the schema of the lines of these events."""
    definitions: dict[str, Any] = {}
    for event in events:
        template = "#/$defs/{model}"
        adapter = TypeAdapter[Any](event)
        one = adapter.json_schema(
            mode="serialization", schema_generator=_TraceSchema, ref_template=template
        )
        definitions |= one.pop("$defs", {})
        one["properties"] |= _traced_otherwise(event)
        shown = {name: one["properties"][name] for name in traced_fields(event)}
        one["properties"] = {"kind": {"const": event.kind}, "traced_s": {"type": "number"}, **shown}
        one["required"] = ["kind", "traced_s", *shown]
        definitions[event.kind] = one | {"additionalProperties": False}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"onboard, version {VERSION}",
        "oneOf": [{"$ref": f"#/$defs/{event.kind}"} for event in events],
        "$defs": definitions,
    }


def _traced_otherwise(event: type) -> dict[str, Any]:
    """Return the schemas of the fields that a trace has as `traced_as` makes them."""
    return {
        each.name: TypeAdapter[Any](
            get_type_hints(each.metadata["traced_as"])["return"]
        ).json_schema(mode="serialization", schema_generator=_TraceSchema)
        for each in fields(event)
        if "traced_as" in each.metadata
    }


def schema() -> None:
    """Print the JSON schema of the trace. The live interface sends its lines, too."""
    typer.echo(json.dumps(schema_of(), indent=2))
