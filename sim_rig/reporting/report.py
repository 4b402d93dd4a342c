"""Text report of a run: timeline, warnings, perceived objects, discarded messages, latencies."""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from sim_rig.reporting.verdict import Outcome, Verdict
from sim_rig.run_log.ground_truth import MatchedObject, match_object, perceived_objects, touch_s
from sim_rig.run_log.latency_ledger import ledger
from sim_rig.run_log.lateness import LatenessLine
from sim_rig.run_log.picture_delay import picture_delay
from sim_rig.run_log.run_log import Record, RunLog
from sim_rig.scenario.schema import Scenario

_TIMELINE_KINDS = frozenset(
    {"transition", "hard_brake", "warning", "alarm", "sensor_lost", "sensor_recovered"}
)


def failures(scenario: Scenario, log: RunLog) -> list[str]:
    """One sentence for each deviation from the scenario's expectations."""
    return [sentence for entry in scenario.expect for sentence in entry.check(log)]


def print_report(scenario: Scenario, log: RunLog, console: Console) -> None:
    """Print the timeline and all tables that have rows.

    Args:
        scenario: the scenario of the run.
        log: its run log.
        console: where to print.
    """
    console.print(_timeline(scenario, log))
    if any(True for car in log.traces for _ in log.brakings(car)):
        console.print(_warnings(log))
    if scenario.gnss is not None:
        console.print(_perceived(log, scenario.duration_s))
    pictures = _picture_delays(scenario, log)
    for table in (
        _discards(log),
        _ledger(log),
        pictures,
        _clocks(log),
        lateness_table(log.lateness),
        lateness_table(log.daemon_lateness, of="the daemons"),
    ):
        if table.row_count:
            console.print(table)
    for car, notes in log.notes.items():
        for note in notes:
            console.print(f"[dim]{car}: {note}[/dim]", soft_wrap=True)


def print_verdict(judged: Verdict, count: int, console: Console) -> None:
    """Print which of `count` expectations failed, or that none did, and what is not judged.

    What was not met in a late run is no failure: it comes after the reason, as not judged.
    """
    for sentence in judged.invalid:
        console.print(f"[yellow]INVALID[/yellow] {sentence}", soft_wrap=True)
    failed = "[dim]not judged[/dim]" if judged.was_late else "[red]FAILED[/red]"
    for sentence in judged.failures:
        console.print(f"{failed} {sentence}", soft_wrap=True)
    for sentence in judged.not_judged:
        console.print(f"[dim]not judged[/dim] {sentence}", soft_wrap=True)
    if judged.outcome is Outcome.PASSED:
        judged_ones = count - len(judged.not_judged)
        what = f"{judged_ones} of" if judged.not_judged else "all"
        console.print(f"[green]PASSED[/green] {what} {count} expectations")


def _empty_table(title: str, columns: Sequence[str], numbers: Collection[str]) -> Table:
    """Return a table without rows; the columns that hold `numbers` are aligned to the right."""
    table = Table(title=title, box=box.SIMPLE, title_justify="left")
    for column in columns:
        table.add_column(column, justify="right" if column in numbers else "left")
    return table


def _timeline(scenario: Scenario, log: RunLog) -> Table:
    table = _empty_table("Timeline", ("s", "car", "what"), numbers={"s"})
    entries = [
        (_reported_at_s(log, record), car, _description(log, car, record))
        for car, records in log.traces.items()
        for record in records
        if record["kind"] in _TIMELINE_KINDS and record.get("cause") != "refresh"
    ]
    for fault in scenario.faults:
        what = fault.what.replace("_", " ")
        entries.append((fault.from_s, fault.car, f"[dim]fault: {what}[/dim]"))
        entries.append((fault.until_s, fault.car, f"[dim]fault over: {what}[/dim]"))
    for at_s, car, what in sorted(entries):
        table.add_row(f"{at_s:.3f}", car, what)
    if any(at_s < 0.0 for at_s, _, _ in entries):
        table.caption, table.caption_justify = "Before 0 s: starting up", "left"
    return table


def _reported_at_s(log: RunLog, record: Record) -> float:
    """Time of a report: a camera recovers with an image that may be older than its loss."""
    if record["kind"] == "sensor_recovered" and "traced_s" in record:
        return float(record["traced_s"]) - log.start_s
    return log.at_s(record)


def _description(log: RunLog, car: str, record: Record) -> str:
    match record["kind"]:
        case "transition":
            place = f"number {record['group_number']} behind {log.name(record['leader_id'])}"
            state = record["state"].upper()
            text = f"{state}, {place}" if record["state"] == "member" else state
            return f"{text} [dim]({record['event']}: {record['cause']})[/dim]"
        case "hard_brake":
            text = f"[bold]brakes with {record['deceleration_m_s2']:.1f} m/s2[/bold]"
            return "hard braking is over" if record["is_over"] else text
        case "warning":
            origin = log.name(record["origin_id"])
            return f"[bold red]WARNED: {origin} brakes[/bold red] [dim](hop {record['hops']})[/dim]"
        case "alarm":
            return _alarm(log, car, record)
        case "sensor_lost":
            return f"[yellow]{record['sensor']} lost[/yellow] [dim]({record['reason']})[/dim]"
        case _:
            return f"{record['sensor']} recovered"


def _alarm(log: RunLog, car: str, alarm: Record) -> str:
    """Text of an alarm: the other car, its object source, and the time to contact of the two."""
    cause = alarm["cause"].replace("_", " ")
    if alarm["level"] == "none":
        return f"[dim]{cause}: over[/dim]"
    colour = "bold red" if alarm["level"] == "warning" else "yellow"
    text = f"[{colour}]{alarm['level'].upper()}: {cause}[/{colour}]"
    for reason in alarm["reasons"]:
        matched = match_object(log, car, reason["name"], log.at_s(alarm))
        if matched is not None and matched.true_car is not None:
            touch = touch_s(log, car, matched.true_car)
            lead = "" if touch is None else f", {touch - log.at_s(alarm):.1f} s before they touch"
            return f"{text} with {matched.true_car} [dim](source: {matched.source}{lead})[/dim]"
    return text


def _perceived(log: RunLog, duration_s: float) -> Table:
    """Table of the cars that each car perceived: source, interval, and largest position error."""
    numbers = ("from s", "until s", "largest error m")
    table = _empty_table("Perceived objects", ("host", "car", "source", *numbers), numbers)
    for car in log.traces:
        found: dict[tuple[str, str], list[MatchedObject]] = {}
        for snapshot in perceived_objects(log, car, 0.0, duration_s):
            for matched in snapshot:
                found.setdefault((matched.true_car or "(no car)", matched.source), []).append(
                    matched
                )
        for (true_car, source), times in sorted(found.items()):
            table.add_row(
                car,
                true_car,
                source,
                f"{times[0].at_s:.0f}",
                f"{times[-1].at_s:.0f}",
                f"{max(matched.error_m for matched in times):.1f}",
            )
    return table


def _warnings(log: RunLog) -> Table:
    """Table of the brakings; delays count from the sample that confirms the braking."""
    columns = ("s", "braking", "warned (after ms, over hops)")
    table = _empty_table("Warnings", columns, numbers={"s"})
    for braking in log.traces:
        for brake in log.brakings(braking):
            at_s = log.at_s(brake)
            table.add_row(f"{at_s:.3f}", braking, ", ".join(_warned(log, braking, at_s)) or "none")
    return table


def _warned(log: RunLog, braking: str, at_s: float) -> Iterator[str]:
    for car in log.traces:
        for warning in log.of(car, "warning", at_s, at_s + 3.0):
            if log.name(warning["origin_id"]) == braking:
                after_ms = (log.at_s(warning) - at_s) * 1e3
                yield f"{car} ({after_ms:.1f}, {warning['hops']})"
                break


def _discards(log: RunLog) -> Table:
    columns = ("car", "component", "reason", "times")
    table = _empty_table("Discarded messages", columns, numbers={"times"})
    for car, records in log.traces.items():
        counted = Counter(
            (record["component"], record["reason"])
            for record in records
            if record["kind"] == "discarded"
        )
        for (component, reason), times in sorted(counted.items()):
            table.add_row(car, component, reason, str(times))
    return table


def _ledger(log: RunLog) -> Table:
    numbers = ("n", "p50 ms", "p99 ms")
    table = _empty_table("Latency ledger", ("hop", *numbers), numbers)
    for line in ledger(log):
        table.add_row(line.hop, str(line.n), f"{line.p50_s * 1e3:.2f}", f"{line.p99_s * 1e3:.2f}")
    return table


def _picture_delays(scenario: Scenario, log: RunLog) -> Table:
    """Table of how long after the exposure the pictures of each car are stamped."""
    table = Table(title="Delay of the pictures", box=box.SIMPLE, title_justify="left")
    for column in ("car", "ms", "+- ms", "pictures"):
        table.add_column(column, justify="left" if column == "car" else "right")
    plates = {car.plate: name for name, car in scenario.cars.items() if car.plate is not None}
    for car in log.traces:
        found = picture_delay(log, car, plates)
        if found is not None:
            delays_ms = (f"{each * 1e3:.0f}" for each in (found.delay_s, found.uncertainty_s))
            table.add_row(car, *delays_ms, str(found.pictures))
    return table


def _clocks(log: RunLog) -> Table:
    """Table of the boxes' clocks, to which their times and ledger lines are true."""
    numbers = ("rig - box s", "+- ms", "frames from", "to it")
    table = _empty_table("Clocks of the boxes", ("car", *numbers), numbers)
    of_cars = ((car, clock) for car, clocks in log.clocks.items() for clock in clocks)
    for car, clock in of_cars:
        table.add_row(
            car,
            f"{clock.offset_s:.6f}",
            f"{clock.uncertainty_s * 1e3:.2f}",
            str(clock.frames_from_box),
            str(clock.frames_to_box),
        )
    return table


def lateness_table(lines: Iterable[LatenessLine], of: str = "the rig") -> Table:
    """Table of how late the rig was, or `of` something else."""
    numbers = ("n", "p50 ms", "p99 ms", "limit ms", "missed")
    table = _empty_table(f"Lateness of {of}", ("what", *numbers), numbers)
    for line in lines:
        table.add_row(
            line.what,
            str(line.n),
            f"{line.p50_s * 1e3:.2f}",
            f"{line.p99_s * 1e3:.2f}",
            f"{line.limit_s * 1e3:.0f}",
            str(line.misses),
        )
    return table
