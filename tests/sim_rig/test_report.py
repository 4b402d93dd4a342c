"""The report tells a run in the order in which the cars came to know it."""

from rich.console import Console

from sim_rig.reporting.report import print_report
from sim_rig.run_log.run_log import RunLog
from sim_rig.scenario.schema import load_scenario


def the_report(*records: dict[str, object]) -> str:
    """What is printed of a run in which red wrote these records; it began at 100 s."""
    log = RunLog(start_s=100.0, traces={"red": records}, rig=[], names={})
    console = Console(width=100)
    with console.capture() as captured:
        print_report(load_scenario("fig4"), log, console)
    return captured.get()


def lost(stamp_s: float) -> dict[str, object]:
    what = {"kind": "sensor_lost", "sensor": "camera", "silent_s": 0.8, "reason": "silent"}
    return what | {"stamp_s": stamp_s, "traced_s": stamp_s + 0.001}


def back(stamp_s: float, traced_s: float) -> dict[str, object]:
    what = {"kind": "sensor_recovered", "sensor": "camera"}
    return what | {"stamp_s": stamp_s, "traced_s": traced_s}


def test_a_camera_that_is_back_with_an_old_picture_is_told_after_its_loss() -> None:
    report = the_report(lost(103.2), back(102.6, traced_s=103.3))
    assert report.index("3.200") < report.index("camera lost")
    assert report.index("camera lost") < report.index("3.300") < report.index("camera back")


def test_a_record_without_a_time_of_writing_is_told_at_its_stamp() -> None:
    report = the_report({"stamp_s": 104.5, "kind": "sensor_recovered", "sensor": "gnss"})
    assert "4.500   red   gnss back" in report


def test_what_is_before_zero_is_explained() -> None:
    assert "Before 0 s" in the_report(lost(99.5), back(99.6, traced_s=99.6))
    assert "Before 0 s" not in the_report(lost(100.5), back(100.6, traced_s=100.6))
