"""Plates in recorded values: replaced by aliases, in every field that has one."""

import sys
from dataclasses import fields, is_dataclass, replace
from typing import Any, get_args, get_type_hints

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.lcca.plate_series import letters_and_number
from onboard.observations import (
    DetectionList,
    ImageBox,
    Lead,
    LeadIdentity,
    Plate,
    PlateCandidate,
    VehicleDetection,
)
from onboard.recorder.identities import ALIAS_LENGTH, Aliases
from onboard.recorder.inputs import as_input
from onboard.recorder.reader import Entry
from onboard.recorder.records import StepEnd
from onboard.replay.recorded_stack import recorded_stack  # noqa: F401 (imports all events)
from onboard.security.plate_digest import normalised
from onboard.trace.trace_line import Event, as_json, as_record

PLATE = "GN417KB"
DETECTION = VehicleDetection(1.0, 3, 20.0, 1.0, 0.1, 0.01, PLATE)
WITH_PLATES = [
    Lead(1.0, LeadIdentity.KNOWN, PLATE, 20.0, candidates=(PlateCandidate(PLATE, 0.9),)),
    Lead(1.0, LeadIdentity.UNKNOWN, None, 20.0, candidates=(PlateCandidate(PLATE, 0.2),)),
    Plate(1.0, ImageBox(1.0, 2.0, 3.0, 4.0), PLATE, 0.9, is_lead=True),
    DETECTION,
    DetectionList(1.0, (replace(DETECTION, text=None), DETECTION)),
]

texts = st.text("ABCDEFGHIOZ0123456789", min_size=1, max_size=10)
leads = st.builds(
    Lead,
    st.floats(0.0, 1e6),
    st.sampled_from(LeadIdentity),
    text=st.none() | texts,
    gap_m=st.none() | st.floats(0.0, 200.0),
    track_id=st.none() | st.integers(0, 2**31),
    candidates=st.lists(st.builds(PlateCandidate, texts, st.floats(0.0, 1.0)), max_size=16).map(
        tuple
    ),
)


def recorded(value: Event) -> bytes:
    return as_json(as_record(value)).encode()


@pytest.mark.parametrize("value", WITH_PLATES, ids=lambda value: value.kind)
def test_no_plate_is_left(value: Event) -> None:
    assert PLATE.encode() in recorded(value)

    assert PLATE.encode() not in recorded(Aliases(in_clear=False).replace_plates(value))


def _is_event(kind: Any) -> bool:
    return is_dataclass(kind) and isinstance(getattr(kind, "kind", None), str)


def _has_text(kind: Any) -> bool:
    """Whether a type of values, or one that it is made of, has a field `text`."""
    if get_args(kind):
        return any(map(_has_text, get_args(kind)))
    return is_dataclass(kind) and ("text" in _fields(kind) or _has_inner_text(kind))


def _has_inner_text(kind: Any) -> bool:
    return any(_has_text(hint) for hint in _fields(kind).values())


def _fields(kind: Any) -> dict[str, Any]:
    hints = get_type_hints(kind)
    return {field.name: hints[field.name] for field in fields(kind)}


def test_every_event_of_the_cores_with_a_text_in_an_inner_value_is_among_those_tested() -> None:
    modules = [module for name, module in sys.modules.items() if name.startswith("onboard.")]
    events = {each for module in modules for each in vars(module).values() if _is_event(each)}

    assert {Lead, Plate, StepEnd} <= events, "the modules of the stack are imported"
    assert {each for each in events if _has_inner_text(each)} == {Lead, DetectionList}


@given(lead=leads)
def test_a_lead_is_read_as_it_was_recorded(lead: Lead) -> None:
    named = Aliases(in_clear=False).replace_plates(lead)

    assert as_input(Entry("/in/lead", 1.75e9, recorded(named))) == named
    assert replace(named, text=lead.text, candidates=lead.candidates) == lead


@given(lead=leads)
def test_texts_that_share_an_id_share_an_alias(lead: Lead) -> None:
    named = Aliases(in_clear=False).replace_plates(lead)

    pairs = list(zip(lead.candidates, named.candidates, strict=True))
    alias_of = {normalised(text.text): alias.text for text, alias in pairs}
    assert all(alias_of[normalised(text.text)] == alias.text for text, alias in pairs)
    assert all(len(alias.text) == ALIAS_LENGTH for _, alias in pairs)
    assert [text.probability for text, _ in pairs] == [alias.probability for _, alias in pairs]


def test_an_alias_shows_of_a_plate_only_which_others_have_almost_its_number() -> None:
    aliases = Aliases(in_clear=False)
    letters, number = letters_and_number(aliases.alias("GN417KB"))
    near, other = (letters_and_number(aliases.alias(each)) for each in ("GN 4 22KB", "GM417KB"))

    assert near == (letters, number + 5)
    assert other[0] != letters
    assert letters_and_number(Aliases(in_clear=False).alias("GN417KB")) != (letters, number)
