"""BSMs: bits as of other ASN.1 compilers, values as in SAE J2735."""

import contextlib
import json
import math
from dataclasses import replace
from pathlib import Path
from random import Random
from types import ModuleType
from typing import Any

import asn1tools
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies._internal.core import DataObject

from onboard.errors import DecodeError
from onboard.messages import bsm
from onboard.messages.bit_io import BitWriter
from onboard.messages.bsm import BasicSafetyMessage, OtherPart
from onboard.messages.bsm_core import (
    CORE,
    AccelerationSet,
    BrakeSystemStatus,
    ControlStatus,
    CoreData,
    PositionalAccuracy,
    TransmissionState,
    VehicleSize,
    WheelBrakes,
)
from onboard.messages.bsm_safety import (
    SAFETY,
    ExteriorLights,
    PathPrediction,
    VehicleEventFlags,
    VehicleSafetyExtensions,
)
from onboard.messages.message_frame import RegionalExtension
from tests.messages.strategies import records
from tests.typed import about

ORACLE_TEXT = Path(__file__).with_name("bsm_oracle.asn1")
ORACLE = asn1tools.compile_files(str(ORACLE_TEXT), "uper")
SILENT = BasicSafetyMessage(CoreData(msg_cnt=7, temporary_id=b"\x01\x02\x03\x04"))

# ---- what the oracle is asked to encode: any value that its grammar allows ---------------------

accuracies = st.fixed_dictionaries(
    {
        "semiMajor": st.integers(0, 255),
        "semiMinor": st.integers(0, 255),
        "orientation": st.integers(0, 65535),
    }
)
latitudes = st.integers(-900_000_000, 900_000_001)
longitudes = st.integers(-1_799_999_999, 1_800_000_001)
elevations = st.integers(-4096, 61439)
speeds = st.integers(0, 8191)
headings = st.integers(0, 28800)
# A field that may be left out is not also sent as "unavailable": both are read as None.
known_elevations = st.integers(-4095, 61439)
known_speeds = st.integers(0, 8190)
known_headings = st.integers(0, 28799)
gears = st.sampled_from(["neutral", "park", "forward", "reverse", "r1", "r2", "r3", "unavailable"])
controls = st.sampled_from(["unavailable", "off", "on", "engaged"])


def bit_strings(bits: int) -> st.SearchStrategy[tuple[bytes, int]]:
    return st.integers(0, 2**bits - 1).map(
        lambda number: ((number << -bits % 8).to_bytes((bits + 7) // 8), bits)
    )


cores = st.fixed_dictionaries(
    {
        "msgCnt": st.integers(0, 127),
        "id": st.binary(min_size=4, max_size=4),
        "secMark": st.integers(0, 65535),
        "lat": latitudes,
        "long": longitudes,
        "elev": elevations,
        "accuracy": accuracies,
        "transmission": gears,
        "speed": speeds,
        "heading": headings,
        "angle": st.integers(-126, 127),
        "accelSet": st.fixed_dictionaries(
            {
                "long": st.integers(-2000, 2001),
                "lat": st.integers(-2000, 2001),
                "vert": st.integers(-127, 127),
                "yaw": st.integers(-32767, 32767),
            }
        ),
        "brakes": st.fixed_dictionaries(
            {
                "wheelBrakes": bit_strings(5),
                "traction": controls,
                "abs": controls,
                "scs": controls,
                "brakeBoost": st.sampled_from(["unavailable", "off", "on"]),
                "auxBrakes": st.sampled_from(["unavailable", "off", "on", "reserved"]),
            }
        ),
        "size": st.fixed_dictionaries(
            {"width": st.integers(0, 1023), "length": st.integers(0, 4095)}
        ),
    }
)
positions = st.fixed_dictionaries(
    {"long": longitudes, "lat": latitudes},
    optional={
        "utcTime": st.fixed_dictionaries(
            {},
            optional={
                "year": st.integers(0, 4095),
                "month": st.integers(0, 12),
                "day": st.integers(0, 31),
                "hour": st.integers(0, 31),
                "minute": st.integers(0, 60),
                "second": st.integers(0, 65535),
                "offset": st.integers(-840, 840),
            },
        ),
        "elevation": known_elevations,
        "heading": known_headings,
        "speed": st.fixed_dictionaries({"gear": gears, "speed": speeds}),
        "posAccuracy": accuracies,
        "timeConfidence": st.integers(0, 39),
        "posConfidence": st.fixed_dictionaries(
            {"pos": st.integers(0, 15), "elevation": st.integers(0, 15)}
        ),
        "speedConfidence": st.fixed_dictionaries(
            {
                "heading": st.integers(0, 7),
                "speed": st.integers(0, 7),
                "throttle": st.integers(0, 3),
            }
        ),
    },
)
crumbs = st.fixed_dictionaries(
    {
        "latOffset": st.integers(-131072, 131071),
        "lonOffset": st.integers(-131072, 131071),
        "elevationOffset": st.integers(-2048, 2047),
        "timeOffset": st.integers(1, 65535),
    },
    optional={"speed": known_speeds, "posAccuracy": accuracies, "heading": st.integers(0, 239)},
)
safeties = st.fixed_dictionaries(
    {},
    optional={
        "events": bit_strings(13),
        "pathHistory": st.fixed_dictionaries(
            {"crumbData": st.lists(crumbs, min_size=1, max_size=23)},
            optional={"initialPosition": positions, "currGNSSstatus": bit_strings(8)},
        ),
        "pathPrediction": st.fixed_dictionaries(
            {"radiusOfCurve": st.integers(-32767, 32767), "confidence": st.integers(0, 200)}
        ),
        "lights": bit_strings(9),
    },
)


def framed(
    core: dict[str, Any],
    safety: Any = None,
    other_parts: list[tuple[int, bytes]] | tuple[()] = (),
    regions: list[tuple[int, bytes]] | tuple[()] = (),
) -> bytes:
    parts = [] if safety is None else [{"id": 0, "value": ORACLE.encode("Safety", safety)}]
    parts += [{"id": part_id, "value": value} for part_id, value in other_parts]
    message: dict[str, Any] = {"core": core}
    if parts:
        message["parts"] = parts
    if regions:
        message["regions"] = [{"id": region_id, "value": value} for region_id, value in regions]
    value = ORACLE.encode("Bsm", message)
    return bytes(ORACLE.encode("Frame", {"messageId": 20, "value": value}))


# ---- round trips --------------------------------------------------------------------------------


@given(
    core=cores,
    safety=st.none() | safeties,
    other_parts=st.lists(st.tuples(st.integers(1, 63), st.binary(max_size=200)), max_size=7),
    footer=st.none() | st.binary(max_size=bsm.MAX_FOOTER_BYTES),
    other_regions=st.lists(st.tuples(st.integers(0, 127), st.binary(max_size=40)), max_size=3),
)
def test_bsms_of_another_compiler_are_decoded_and_encoded_bit_for_bit(
    core: dict[str, Any],
    safety: Any,
    other_parts: list[tuple[int, bytes]],
    footer: bytes | None,
    other_regions: list[tuple[int, bytes]],
) -> None:
    regions = [(bsm.FOOTER_REGION, footer)] if footer is not None else []
    frame = framed(core, safety, other_parts, regions + other_regions)
    message = bsm.decode(frame)
    assert bsm.encode(message) == frame
    assert message.footer == footer
    assert [(part.part_id, part.content) for part in message.other_parts] == other_parts
    assert [(r.region_id, r.content) for r in message.other_regions] == other_regions
    json.dumps(bsm.as_dict(message), allow_nan=False)


@given(safety=safeties)
def test_safety_extensions_are_decoded_by_another_compiler(safety: Any) -> None:
    ours = SAFETY.encode(SAFETY.decode(ORACLE.encode("Safety", safety)))
    assert ORACLE.decode("Safety", ours) == safety


@given(records(CORE), st.none() | records(SAFETY))
def test_every_declared_message_survives_encoding_and_decoding(
    core: CoreData, safety: VehicleSafetyExtensions | None
) -> None:
    message = BasicSafetyMessage(core, safety)
    assert bsm.decode(bsm.encode(message)) == message
    json.dumps(bsm.as_dict(message), allow_nan=False)


def test_an_optional_field_sent_as_unavailable_is_none_and_left_out_when_written() -> None:
    crumb = {"latOffset": 1, "lonOffset": 1, "elevationOffset": 1, "timeOffset": 1}
    theirs = {"pathHistory": {"crumbData": [crumb | {"speed": 8191, "heading": 240}]}}
    safety = SAFETY.decode(ORACLE.encode("Safety", theirs))
    assert safety.path_history is not None
    point = safety.path_history.crumb_data[0]
    assert (point.speed_m_s, point.heading_rad) == (None, None)
    assert ORACLE.decode("Safety", SAFETY.encode(safety)) == {"pathHistory": {"crumbData": [crumb]}}


# ---- values -------------------------------------------------------------------------------------

RAW_CORE = {
    "msgCnt": 127,
    "id": b"\xde\xad\xbe\xef",
    "secMark": 59_999,
    "lat": -337_600_001,
    "long": 1_511_999_999,
    "elev": -123,
    "accuracy": {"semiMajor": 40, "semiMinor": 20, "orientation": 16384},
    "transmission": "forward",
    "speed": 1389,
    "heading": 7200,
    "angle": -20,
    "accelSet": {"long": -412, "lat": 25, "vert": -50, "yaw": 1500},
    "brakes": {
        "wheelBrakes": (b"\x50", 5),
        "traction": "off",
        "abs": "engaged",
        "scs": "on",
        "brakeBoost": "unavailable",
        "auxBrakes": "reserved",
    },
    "size": {"width": 185, "length": 450},
}


@pytest.mark.parametrize(("sent_deg", "received_deg"), [(-90, 270), (359.999, 0), (725, 5)])
def test_a_heading_is_sent_without_its_whole_turns(sent_deg: float, received_deg: int) -> None:
    core = CoreData(1, bytes(4), heading_rad=math.radians(sent_deg))
    received = bsm.decode(bsm.encode(BasicSafetyMessage(core))).core.heading_rad
    assert received == pytest.approx(math.radians(received_deg))


def test_every_quantity_has_its_si_value() -> None:
    core = bsm.decode(framed(RAW_CORE)).core
    assert (core.msg_cnt, core.temporary_id, core.sec_mark_s) == (127, b"\xde\xad\xbe\xef", 59.999)
    assert (core.latitude_deg, core.longitude_deg, core.elevation_m) == (
        -33.7600001,
        151.1999999,
        -12.3,
    )
    assert core.accuracy.semi_major_m == 2.0
    assert core.accuracy.semi_minor_m == 1.0
    assert core.accuracy.orientation_rad == pytest.approx(math.radians(90), abs=1e-4)
    assert core.transmission is TransmissionState.FORWARD_GEARS
    assert core.speed_m_s == 27.78
    assert core.heading_rad == pytest.approx(math.radians(90))
    assert core.steering_angle_rad == pytest.approx(math.radians(-30))
    assert core.acceleration == AccelerationSet(
        longitudinal_m_s2=-4.12,
        lateral_m_s2=0.25,
        vertical_m_s2=about(-9.80665),
        yaw_rate_rad_s=about(math.radians(15)),
    )
    assert core.brakes == BrakeSystemStatus(
        wheel_brakes=WheelBrakes.LEFT_FRONT | WheelBrakes.RIGHT_FRONT,
        traction=ControlStatus.OFF,
        abs=ControlStatus.ENGAGED,
        stability=ControlStatus.ON,
        brake_boost=None,
        auxiliary=core.brakes.auxiliary,
    )
    assert core.size == VehicleSize(width_m=1.85, length_m=4.5)


def test_missing_values_are_sent_as_the_unavailable_codes_of_the_standard() -> None:
    raw = ORACLE.decode(
        "Bsm", ORACLE.decode("Frame", bsm.encode(SILENT))["value"], check_constraints=True
    )
    assert raw == {
        "core": {
            "msgCnt": 7,
            "id": b"\x01\x02\x03\x04",
            "secMark": 65535,
            "lat": 900_000_001,
            "long": 1_800_000_001,
            "elev": -4096,
            "accuracy": {"semiMajor": 255, "semiMinor": 255, "orientation": 65535},
            "transmission": "unavailable",
            "speed": 8191,
            "heading": 28800,
            "angle": 127,
            "accelSet": {"long": 2001, "lat": 2001, "vert": -127, "yaw": 0},
            "brakes": {
                "wheelBrakes": (b"\x80", 5),
                "traction": "unavailable",
                "abs": "unavailable",
                "scs": "unavailable",
                "brakeBoost": "unavailable",
                "auxBrakes": "unavailable",
            },
            "size": {"width": 0, "length": 0},
        }
    }
    assert bsm.decode(bsm.encode(SILENT)) == SILENT


def test_values_beyond_the_range_are_sent_as_its_end() -> None:
    core = replace(
        SILENT.core,
        speed_m_s=500.0,
        accuracy=PositionalAccuracy(semi_major_m=99.0),
        acceleration=AccelerationSet(longitudinal_m_s2=-50.0),
    )
    read = bsm.decode(bsm.encode(BasicSafetyMessage(core))).core
    assert read.speed_m_s == 163.8
    assert read.accuracy.semi_major_m == 12.7
    assert read.acceleration.longitudinal_m_s2 == -20.0


def test_hard_braking_is_flag_seven_and_raises_the_user_priority() -> None:
    braking = VehicleSafetyExtensions(events=VehicleEventFlags.HARD_BRAKING)
    frame = bsm.encode(replace(SILENT, safety=braking))
    parts = ORACLE.decode("Bsm", ORACLE.decode("Frame", frame)["value"])["parts"]
    assert ORACLE.decode("Safety", parts[0]["value"])["events"] == (b"\x01\x00", 13)
    assert SILENT.user_priority < bsm.decode(frame).user_priority == 7


def test_a_straight_prediction_has_no_radius_and_lights_have_names() -> None:
    safety = SAFETY.decode(
        ORACLE.encode(
            "Safety",
            {
                "pathPrediction": {"radiusOfCurve": 32767, "confidence": 200},
                "lights": (b"\x88\x00", 9),
            },
        )
    )
    assert safety.path_prediction == PathPrediction(radius_of_curve_m=None, confidence=1.0)
    assert safety.lights == ExteriorLights.LOW_BEAM | ExteriorLights.HAZARD_SIGNAL


# ---- what a later standard may add --------------------------------------------------------------


def test_extensions_of_a_later_edition_are_skipped() -> None:
    tomorrow = ORACLE.encode(
        "SafetyOfTomorrow",
        {"lights": (b"\x80\x00", 9), "mood": 3, "song": b"la" * 80},
    )
    assert SAFETY.decode(tomorrow) == VehicleSafetyExtensions(lights=ExteriorLights.LOW_BEAM)


def test_an_event_flag_of_a_later_edition_is_kept_and_printed(tmp_path: Path) -> None:
    theirs = _pycrate(tmp_path).BsmOracle.Safety
    theirs.set_val({"events": (0b10, 15)})
    encoded = theirs.to_uper()
    safety = SAFETY.decode(encoded)
    assert safety.events == 1 << 13
    assert bsm.as_dict(replace(SILENT, safety=safety))["safety"]["events"] == ["bit_13"]
    theirs.from_uper(SAFETY.encode(safety))
    assert theirs.get_val() == {"events": (0b1, 14)}


@given(st.integers(17, 16_383), st.randoms())
def test_combinations_of_unknown_flags_fill_no_memory(bits: int, random: Random) -> None:
    """Python remembers each combination of flags; so many are there as a sender makes up."""
    flags = random.getrandbits(bits) | 1 << bits - 1
    head = BitWriter()
    head.put(0b0_1000_1, 6)
    head.put_length(bits)
    head.put(int(f"{flags:0{bits}b}"[::-1], 2), bits)
    safety = SAFETY.decode(head.finish())
    assert safety.events == flags & (1 << 16) - 1


def _pycrate(folder: Path) -> ModuleType:
    """The oracle's grammar by another compiler: asn1tools cannot extend bit strings."""
    import importlib.util

    from pycrate_asn1c.asnproc import PycrateGenerator, compile_text, generate_modules

    compile_text(ORACLE_TEXT.read_text())
    generate_modules(PycrateGenerator, str(folder / "oracle.py"))
    spec = importlib.util.spec_from_file_location("oracle", folder / "oracle.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# ---- what is refused ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"footer": bytes(bsm.MAX_FOOTER_BYTES + 1)}, "footer: 801 bytes"),
        ({"other_parts": (OtherPart(64, b""),)}, "part_id: 64 is not 0 to 63"),
        ({"other_regions": (RegionalExtension(1, b""),) * 5}, "regions: 5 is not 1 to 4"),
        ({"core": replace(SILENT.core, temporary_id=b"abc")}, "temporary_id: .* has not 4 bytes"),
        ({"core": replace(SILENT.core, msg_cnt=128)}, "msg_cnt: 128 is not 0 to 127"),
    ],
)
def test_a_value_that_cannot_be_encoded_is_an_error_that_names_the_field(
    change: Any, what: str
) -> None:
    with pytest.raises(ValueError, match=what):
        bsm.encode(replace(SILENT, **change))


def test_each_kind_of_invalid_bytes_has_its_decode_error() -> None:
    good = framed(RAW_CORE, {"events": (b"\x01\x00", 13)})
    core = bytes(good[4:])
    twice = framed(RAW_CORE, {}, [(0, b"\x00")])
    cases = {
        b"": "too_short",
        good[:-1]: "too_short",
        good[:2] + bytes((good[2] + 1,)) + good[3:] + b"\x00": "trailing_bytes",
        b"\x00\x12" + good[2:]: "not_a_bsm",
        twice: "repeated",
        b"\x00\x14\xc4" + core: "too_long",
        framed(RAW_CORE, regions=[(bsm.FOOTER_REGION, bytes(801))]): "too_long",
        ORACLE.encode("Frame", {"messageId": 20, "value": b"\x1f" + b"\xff" * 40}): "out_of_range",
    }
    assert {data: _reason(data) for data in cases} == cases


@given(core=cores, safety=safeties, rest=st.binary(min_size=1, max_size=40))
def test_what_follows_the_frame_is_no_part_of_the_message(
    core: dict[str, Any], safety: Any, rest: bytes
) -> None:
    frame = framed(core, safety)
    assert bsm.decode(frame + rest) == bsm.decode(frame)


def _reason(data: bytes) -> str:
    with pytest.raises(DecodeError) as refused:
        bsm.decode(data)
    return refused.value.reason


@given(core=cores, safety=safeties)
def test_the_temporary_id_is_found_without_decoding_the_rest(
    core: dict[str, Any],
    safety: Any,
) -> None:
    frame = framed(core, safety)
    assert bsm.temporary_id_in(frame) == bsm.decode(frame).core.temporary_id


@given(core=cores, safety=safeties)
def test_event_flags_are_found_without_decoding_the_rest(core: dict[str, Any], safety: Any) -> None:
    frame = framed(core, safety)
    decoded = bsm.decode(frame).safety
    assert bsm.may_tell_event(frame) == (decoded is not None and decoded.events is not None)


@given(st.binary(max_size=60))
def test_any_bytes_may_tell_of_an_event_or_not(noise: bytes) -> None:
    assert bsm.may_tell_event(b"\x00\x14" + noise) in {True, False}
    assert bsm.may_tell_event(b"\x00\x13" + noise), "another message"


@given(st.binary(max_size=20))
def test_any_bytes_give_a_temporary_id_of_four_bytes_or_none(noise: bytes) -> None:
    for given_bytes in (noise, b"\x00\x14" + noise):
        found = bsm.temporary_id_in(given_bytes)
        assert found is None or len(found) == 4
    assert bsm.temporary_id_in(b"\x00\x13" + noise) is None, "another message"


@given(core=cores, safety=safeties, data=st.data())
def test_a_bsm_truncated_anywhere_is_too_short(
    core: dict[str, Any],
    safety: Any,
    data: DataObject,
) -> None:
    frame = framed(core, safety)
    cut = data.draw(st.integers(0, len(frame) - 1))
    assert _reason(frame[:cut]) == "too_short"


@given(noise=st.binary(max_size=300), core=cores, safety=safeties, data=st.data())
def test_any_bytes_raise_only_decode_errors(
    noise: bytes,
    core: dict[str, Any],
    safety: Any,
    data: DataObject,
) -> None:
    frame = bytearray(framed(core, safety))
    for _ in range(data.draw(st.integers(1, 4))):
        frame[data.draw(st.integers(0, len(frame) - 1))] = data.draw(st.integers(0, 255))
    for given_bytes in (noise, b"\x00\x14" + noise, bytes(frame)):
        with contextlib.suppress(DecodeError):
            bsm.as_dict(bsm.decode(given_bytes))
