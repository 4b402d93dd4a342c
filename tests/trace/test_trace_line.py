"""Events as lines of a trace."""

import json

import numpy as np
import pytest

from onboard.observations import ImageBox, Lead, LeadIdentity, Plate, PlateCandidate, Position
from onboard.trace.trace_line import as_json, as_line, as_record, as_trace_record


def test_stamp_and_kind_come_first_then_the_fields_of_the_event() -> None:
    line = as_line(Lead(1.5, LeadIdentity.KNOWN, "ABC123", gap_m=20.25))

    assert line.startswith('{"stamp_s":1.5,"kind":"lead","identity":"known","text":"ABC123"')
    assert json.loads(line)["gap_m"] == 20.25


def test_nested_values_and_none_are_converted() -> None:
    record = as_record(Plate(2.0, ImageBox(1.0, 2.0, 3.0, 4.0), None, 0.0, is_lead=False))

    assert record["box"] == {"x_px": 1.0, "y_px": 2.0, "w_px": 3.0, "h_px": 4.0}
    assert record["text"] is None


def test_a_trace_leaves_out_candidates_and_box_of_a_lead_and_a_recording_has_them() -> None:
    candidates = (PlateCandidate("ABC123", 0.7), PlateCandidate("ABC128", 0.2))
    box = ImageBox(1.0, 2.0, 3.0, 4.0)
    lead = Lead(1.5, LeadIdentity.UNKNOWN, gap_m=20.25, track_id=7, candidates=candidates, box=box)

    recorded, traced = as_record(lead), as_trace_record(lead)

    assert recorded.pop("candidates") == [
        {"text": "ABC123", "probability": 0.7},
        {"text": "ABC128", "probability": 0.2},
    ]
    assert recorded.pop("box") == {"x_px": 1.0, "y_px": 2.0, "w_px": 3.0, "h_px": 4.0}
    assert traced == recorded


def test_floats_are_converted_without_loss() -> None:
    stamp_s = float(np.nextafter(0.1, 1.0))

    assert as_record(Lead(stamp_s, LeadIdentity.NO_LEAD))["stamp_s"] == stamp_s


def test_an_unknown_type_raises() -> None:
    position = Position(1.0, object(), 0.0, None, 1.0, None, None)  # type: ignore[arg-type]

    with pytest.raises(TypeError, match="object cannot be written to a trace"):
        as_line(position)


def test_what_is_not_finite_is_a_string_since_json_has_no_infinity() -> None:
    record = {"value": float("inf"), "others": [1.5, float("-inf")], "at": {"x": float("nan")}}
    assert as_json(record) == '{"value":"inf","others":[1.5,"-inf"],"at":{"x":"nan"}}'
