"""The report lists events in the order in which the cars reported them."""

from rich.console import Console

from sim_rig.reporting.report import print_report, print_verdict
from sim_rig.reporting.verdict import Verdict
from sim_rig.run_log.run_log import RunLog
from sim_rig.scenario.schema import load_scenario


def report_of(*records: dict[str, object]) -> str:
    """Return the report of a run that starts at 100 s and in which red traced `records`."""
    log = RunLog(start_s=100.0, traces={"red": records}, rig=[], names={})
    console = Console(width=100)
    with console.capture() as captured:
        print_report(load_scenario("fig4"), log, console)
    return captured.get()


def lost(stamp_s: float) -> dict[str, object]:
    what = {"kind": "sensor_lost", "sensor": "camera", "silent_s": 0.8, "reason": "silent"}
    return what | {"stamp_s": stamp_s, "traced_s": stamp_s + 0.001}


def recovered(stamp_s: float, traced_s: float) -> dict[str, object]:
    what = {"kind": "sensor_recovered", "sensor": "camera"}
    return what | {"stamp_s": stamp_s, "traced_s": traced_s}


def test_a_recovery_with_an_old_image_is_listed_after_the_loss() -> None:
    report = report_of(lost(103.2), recovered(102.6, traced_s=103.3))
    assert report.index("3.200") < report.index("camera lost")
    assert report.index("camera lost") < report.index("3.300") < report.index("camera recovered")


def test_a_record_without_a_time_of_writing_is_listed_at_its_stamp() -> None:
    report = report_of({"stamp_s": 104.5, "kind": "sensor_recovered", "sensor": "gnss"})
    assert "4.500   red   gnss recovered" in report


def test_events_before_zero_are_explained() -> None:
    assert "Before 0 s" in report_of(lost(99.5), recovered(99.6, traced_s=99.6))
    assert "Before 0 s" not in report_of(lost(100.5), recovered(100.6, traced_s=100.6))


def test_one_braking_is_one_row_of_warnings_whatever_changes_it() -> None:
    brake: dict[str, object] = {"kind": "hard_brake", "cause": "deceleration"}
    report = report_of(
        *(
            brake | {"stamp_s": at_s, "deceleration_m_s2": level_m_s2, "is_over": level_m_s2 == 0.0}
            for at_s, level_m_s2 in [(104.0, 5.0), (104.6, 8.0), (106.0, 0.0), (107.0, 6.0)]
        )
    )
    timeline, warnings = report.split("Warnings")
    assert timeline.count("brakes with") == 3
    assert "6.000   red   hard braking is over" in timeline
    assert warnings.count("none") == 2


def test_what_a_late_run_does_not_meet_is_no_failure_and_stands_after_the_reason() -> None:
    late = Verdict(("green warned nobody",), ("the rig was late: picture",), was_late=True)
    console = Console(width=100)
    with console.capture() as captured:
        print_verdict(late, 2, console)

    assert captured.get().splitlines() == [
        "INVALID the rig was late: picture",
        "not judged green warned nobody",
    ]
