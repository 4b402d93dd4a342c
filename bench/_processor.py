"""Processor time and memory of a daemon and its camera's process, by function."""

from dataclasses import dataclass

import psutil


@dataclass(frozen=True, slots=True)
class Used:
    """What a daemon has used up to now."""

    cpu_s: dict[str, float]
    """By function: `loop` (cores, radio, page, trace), `threads` (recorder, candidate IDs,
    reception from the camera's process) and `camera` (its process)."""
    resident_bytes: int

    @property
    def all_cpu_s(self) -> float:
        """Of all functions."""
        return sum(self.cpu_s.values())

    def cores_since(self, before: "Used", took_s: float) -> dict[str, float]:
        """Return the share of one core by function, since `before`, which is `took_s` ago."""
        return {name: (now_s - before.cpu_s[name]) / took_s for name, now_s in self.cpu_s.items()}


def used(daemon: psutil.Process) -> Used:
    """Read what a process and its child processes have used."""
    threads = {each.id: each.user_time + each.system_time for each in daemon.threads()}
    loop_s = threads.pop(daemon.pid)
    children = daemon.children()
    times = [child.cpu_times() for child in children]
    return Used(
        {
            "loop": loop_s,
            "threads": sum(threads.values()),
            "camera": sum(each.user + each.system for each in times),
        },
        sum(each.memory_info().rss for each in (daemon, *children)),
    )
