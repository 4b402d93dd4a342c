"""What the daemon's log shows on a terminal."""

from onboard.observations import BrakeCause
from onboard.tools.run_cli import flat


def test_an_event_s_fields_stand_beside_its_name_as_text() -> None:
    details = {"stamp_s": 1.5, "kind": "hard_brake", "cause": BrakeCause.TEST, "is_over": False}

    line = flat(None, "info", {"event": "hard_brake", "details": details})

    assert line == {"event": "hard_brake", "cause": "test", "is_over": "False"}


def test_a_line_without_an_event_stays_as_it_is() -> None:
    assert flat(None, "info", {"event": "ready", "plate": "AB123"}) == {
        "event": "ready",
        "plate": "AB123",
    }
