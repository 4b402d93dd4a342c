"""CPM: bits and values as of another codec, what others skip, and what is refused."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import asn1tools
import pytest
from hypothesis import HealthCheck, Phase, example, given, settings
from hypothesis import strategies as st

from onboard.errors import DecodeError
from onboard.messages import cpm
from onboard.messages.cpm import (
    CollectivePerceptionMessage,
    ManagementContainer,
    Orientation,
    PerceivedObjectContainer,
)
from onboard.messages.cpm_evidence import (
    ESTIMATE,
    EVIDENCE,
    MEASUREMENT,
    CpmEvidence,
    EstimateEvidence,
    MeasurementEvidence,
)
from onboard.messages.cpm_object import (
    CARTESIAN,
    POLAR,
    AngularSpeedConfidence,
    AngularVelocity,
    CartesianAngle,
    CartesianVelocity,
    Coordinate,
    CorrelationMatrix,
    CpmObject,
    MapPosition,
    MapReference,
    ObjectClass,
    ObjectDimension,
    ObjectPosition,
    Pedestrian,
    PolarVelocity,
    StateComponent,
    VelocityComponent,
)
from onboard.messages.fields import Chosen
from onboard.messages.its_common import Altitude, ReferencePosition, ReportedSpeed
from onboard.messages.mvs_footer import ObserverRun
from tests.messages.strategies import records

ORACLE = asn1tools.compile_files(str(Path(__file__).with_name("cpm_oracle.asn1")), "uper")
NAME = "CollectivePerceptionMessage"
"""Message of the oracle."""

CAR = CpmObject(
    object_id=513,
    measurement_delta_time_ms=-250,
    position=ObjectPosition(Coordinate(-12.34, 0.5), Coordinate(45.6, 0.7)),
    velocity=Chosen(
        CARTESIAN, CartesianVelocity(VelocityComponent(-13.5, 0.3), VelocityComponent(0.02))
    ),
    classes=(ObjectClass(Chosen("vehicle", 5), 90),),
)
PERSON = replace(
    CAR,
    object_id=7,
    velocity=Chosen(POLAR, PolarVelocity(ReportedSpeed(1.4, 0.1), CartesianAngle(0.0, None))),
    angular_velocity=AngularVelocity(None, AngularSpeedConfidence.DEG_S_5),
    correlations=(CorrelationMatrix(StateComponent.X | StateComponent.Y, ((0.31,),)),),
    length=ObjectDimension(0.6, 0.2),
    age_ms=1500,
    quality=11,
    sensor_ids=(1, 3),
    classes=(
        ObjectClass(Chosen("vru", Chosen("pedestrian", Pedestrian.ROAD_WORKER)), 80),
        ObjectClass(Chosen("vehicle", 0), 20),
    ),
    map_position=MapPosition(Chosen("intersection", MapReference(None, 9)), lane_id=4),
)
MEASURED = Chosen(MEASUREMENT, MeasurementEvidence(1, 0.45, 0.5, -0.25))
FUSED = Chosen(
    ESTIMATE,
    EstimateEvidence(
        0.3, 0.3, 2.0, 2.5, 0.0, 0.5, 0.0, -0.5, 0.0, 0.25,
        (ObserverRun(0, (250, 350)), ObserverRun(1, (300,))),
    ),
)  # fmt: skip
SENT = CollectivePerceptionMessage(
    b"\x01\x02\x03\x04",
    ManagementContainer(717_084_805_250, ReferencePosition(48.1, 11.5, altitude=Altitude(520.0))),
    Orientation(1.5),
    is_road_side_unit=False,
    perceived=PerceivedObjectContainer(9, (CAR, PERSON)),
)


def with_evidence(*pieces: Chosen) -> CollectivePerceptionMessage:
    evidence = CpmEvidence(1, (b"aaaa", b"bbbb"), pieces)
    return replace(SENT, perceived=replace(SENT.perceived, evidence=evidence))


def test_every_field_is_that_of_another_codec() -> None:
    theirs = ORACLE.decode(NAME, cpm.encode(SENT))
    assert theirs["header"] == {"protocolVersion": 2, "messageId": 14, "stationId": 0x01020304}
    management = theirs["payload"]["managementContainer"]
    assert management["referenceTime"] == 717_084_805_250
    place = management["referencePosition"]
    assert (place["latitude"], place["longitude"]) == (481_000_000, 115_000_000)
    assert place["positionConfidenceEllipse"]["semiMajorConfidence"] == 4095
    assert place["altitude"] == {"altitudeValue": 52_000, "altitudeConfidence": 15}
    sender, objects = theirs["payload"]["cpmContainers"]
    assert (sender["containerId"], objects["containerId"]) == (1, 5)
    assert ORACLE.decode("OriginatingVehicleContainer", sender["containerData"]) == {
        "orientationAngle": {"value": 859, "confidence": 127}
    }
    perceived = ORACLE.decode("PerceivedObjectContainer", objects["containerData"])
    assert perceived["numberOfPerceivedObjects"] == 9
    car, person = perceived["perceivedObjects"]
    assert car == {
        "objectId": 513,
        "measurementDeltaTime": -250,
        "position": {
            "xCoordinate": {"value": -1234, "confidence": 50},
            "yCoordinate": {"value": 4560, "confidence": 70},
        },
        "velocity": (
            "cartesianVelocity",
            {
                "xVelocity": {"value": -1350, "confidence": 30},
                "yVelocity": {"value": 2, "confidence": 127},
            },
        ),
        "classification": [{"objectClass": ("vehicleSubClass", 5), "confidence": 90}],
    }
    assert person["velocity"] == (
        "polarVelocity",
        {
            "velocityMagnitude": {"speedValue": 140, "speedConfidence": 10},
            "velocityDirection": {"value": 0, "confidence": 127},
        },
    )
    assert person["zAngularVelocity"] == {"value": 256, "confidence": 2}
    (matrix,) = person["lowerTriangularCorrelationMatrices"]
    assert matrix == {
        "componentsIncludedIntheMatrix": (b"\xc0\x00", 13),
        "matrix": [[31]],
    }
    assert person["objectDimensionX"] == {"value": 6, "confidence": 2}
    assert (person["objectAge"], person["objectPerceptionQuality"]) == (1500, 11)
    assert person["sensorIdList"] == [1, 3]
    assert person["classification"][0]["objectClass"] == (
        "vruSubClass",
        ("pedestrian", "roadWorker"),
    )
    assert person["mapPosition"] == {"mapReference": ("intersection", {"id": 9}), "laneId": 4}


def oracle_can_read(container: PerceivedObjectContainer) -> bool:
    """It knows no bit strings that are longer than declared."""
    return all(
        matrix.components < 1 << 13
        for each in container.objects
        for matrix in each.correlations or ()
    )


few = settings(
    max_examples=30,
    deadline=None,
    phases=[Phase.explicit, Phase.reuse, Phase.generate],  # shrinking takes minutes
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)


@pytest.mark.long
@few
@given(records(cpm.OBJECTS, most=2).filter(oracle_can_read))
@example(cpm.decode(cpm.encode(with_evidence(MEASURED, FUSED))).perceived)
def test_every_container_has_the_bits_of_another_codec_which_skips_what_mvs_adds(
    container: PerceivedObjectContainer,
) -> None:
    data = cpm.OBJECTS.encode(container)
    assert cpm.OBJECTS.decode(data) == container
    plain = cpm.OBJECTS.encode(replace(container, evidence=None))
    theirs = ORACLE.decode("PerceivedObjectContainer", data)
    assert theirs == ORACLE.decode("PerceivedObjectContainer", plain)
    assert ORACLE.encode("PerceivedObjectContainer", theirs) == plain
    if container.evidence is not None:
        added = EVIDENCE.encode(container.evidence)
        assert ORACLE.encode("Evidence", ORACLE.decode("Evidence", added)) == added


@pytest.mark.long
@few
@given(records(cpm.CPM, most=2))
def test_every_message_has_the_bits_of_another_codec_and_is_read_again(message: Any) -> None:
    data = cpm._HEAD + cpm.CPM.encode(message)
    assert ORACLE.encode(NAME, ORACLE.decode(NAME, data)) == data
    assert cpm.CPM.decode(data[2:]) == message


def test_a_message_with_what_mvs_adds_is_read_again() -> None:
    message = with_evidence(MEASURED, FUSED)
    read = cpm.decode(cpm.encode(message))
    assert cpm.encode(read) == cpm.encode(message)
    evidence = read.perceived.evidence
    assert evidence is not None
    assert evidence.observers == (b"aaaa", b"bbbb")
    assert evidence.pieces[1].value.runs == FUSED.value.runs
    assert read.perceived.objects == SENT.perceived.objects


def wrapped(*containers: tuple[int, bytes]) -> bytes:
    """Return a message with these containers, by the other codec."""
    theirs = ORACLE.decode(NAME, cpm.encode(SENT))
    theirs["payload"]["cpmContainers"] = [
        {"containerId": number, "containerData": content} for number, content in containers
    ]
    return bytes(ORACLE.encode(NAME, theirs))


def test_containers_of_sensors_and_of_later_editions_are_skipped() -> None:
    objects = 5, cpm.OBJECTS.encode(SENT.perceived)
    read = cpm.decode(wrapped((2, b"\x00"), (3, b"\xff" * 20), (4, b""), (16, b"\x00"), objects))
    assert read == replace(SENT, orientation=None, is_road_side_unit=True)
    assert cpm.decode(wrapped((3, b"\x00"))).perceived.objects == ()


def test_a_message_of_255_objects_is_read() -> None:
    objects = tuple(replace(CAR, object_id=number) for number in range(255))
    full = replace(SENT, perceived=PerceivedObjectContainer(255, objects))
    assert len(cpm.decode(cpm.encode(full)).perceived.objects) == 255
    more = cpm.encode(replace(full, perceived=PerceivedObjectContainer(255, (*objects, CAR))))
    assert _reason(more) == "contradictory_containers"


def test_each_kind_of_invalid_bytes_has_its_reason() -> None:
    good = cpm.encode(SENT)
    objects, unit = cpm.OBJECTS.encode(SENT.perceived), b"\x00"
    fewer = cpm.OBJECTS.encode(replace(SENT.perceived, number_of_objects=1))
    cases = {
        b"": "too_short",
        good[:40]: "too_short",
        b"\x01" + good[1:]: "unknown_version",
        good[:1] + b"\x02" + good[2:]: "not_a_cpm",
        good + b"\x00": "trailing_bytes",
        wrapped((5, objects), (5, objects)): "contradictory_containers",
        wrapped((1, b"\x00\x00\x00\x00"), (2, unit)): "contradictory_containers",
        wrapped((5, fewer)): "contradictory_containers",
        wrapped((5, objects[:-9])): "too_short",
        cpm.encode(with_evidence(MEASURED)): "contradictory_containers",
    }
    assert {data: _reason(data) for data in cases} == cases


@given(st.binary(max_size=80))
def test_any_bytes_raise_only_decode_errors(noise: bytes) -> None:
    good = cpm.encode(with_evidence(MEASURED, FUSED))
    for data in (noise, good[:8] + noise, good[: -len(noise)] + noise, wrapped((5, noise))):
        try:
            cpm.decode(data)
        except DecodeError:
            continue


def test_an_object_is_a_vehicle_by_its_most_probable_class() -> None:
    assert CAR.is_vehicle
    assert not PERSON.is_vehicle
    assert replace(CAR, classes=None).is_vehicle
    assert not replace(CAR, classes=(ObjectClass(Chosen("other", 1)),)).is_vehicle


def _reason(data: bytes) -> str:
    with pytest.raises(DecodeError) as refused:
        cpm.decode(data)
    return refused.value.reason
