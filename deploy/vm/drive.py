"""What is done to the box in the car, and what must come of it. All times are the guest's."""

import json
import timeit
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from deploy.vm.here import Here
from deploy.vm.machine import Machine

FOLDER = "/var/lib/onboard/drive"
"""A small disk of its own."""
TRACE = f"{FOLDER}/trace.jsonl"
BOX = f"{FOLDER}/box"
"""The black box."""
WORDS = "/dev/udp/127.0.0.1/5397"
"""Where the rig listens, as bash reaches it."""
POLL_S, PATIENCE = 0.5, 120
"""Of the guest's time, between two looks at the trace; stamps are exact all the same."""

BACK_S = 5.0
"""From the end of a program to the next one's being ready."""
BOOT_S = 120.0
"""From switching on to ready: mostly Debian's own start on a processor as slow as the guest's."""
WATCHDOG_S = 2.0
STOP_S = 2.0


@dataclass(frozen=True, slots=True)
class StatusRow:
    """One line of the table."""

    what: str
    noticed_s: float | None
    """After which the car said so."""
    whole_s: float | None
    """After which, counted from the end of the trouble, everything was as before."""
    limit_s: float | None
    """Of `whole_s`."""
    remark: str = ""

    @property
    def is_kept(self) -> bool:
        """Whether the limit was."""
        return self.limit_s is None or (self.whole_s is not None and self.whole_s <= self.limit_s)


class NotSeenError(Exception):
    """What had to come did not."""


class VmDrive:
    """The box, what it tells in its trace, and what is done to it."""

    def __init__(self, machine: Machine | Here) -> None:
        self._machine = machine
        self._is_whole = isinstance(machine, Machine)
        self._events: list[dict[str, Any]] = []
        self._offset = 0
        self._rest = ""

    def steps(self) -> Sequence[Callable[[], Iterator[StatusRow]]]:
        """In their order; after the last the car still drives."""
        anywhere = [
            self.start,
            self.warn,
            self.kill,
            self.hang,
            self.take_bus,
            self.take_gpsd,
            self.take_radio,
            self.fill_disk,
            self.refuse_configuration,
        ]
        return [*anywhere, self.step_clock] if self._is_whole else anywhere

    # ---- what is done --------------------------------------------------------------------

    def start(self) -> Iterator[StatusRow]:
        """From `systemctl start` to ready, and to the first of everything."""
        began_s = self._run("systemctl start onboard").began_s
        ready_s = self._seen(began_s, "ready")
        yield StatusRow("start: ready", None, ready_s - began_s, BACK_S)
        for what, kind, fields in (
            ("start: speed by the ECU", "speed", {}),
            ("start: position by gpsd", "position", {}),
            ("start: lead car by its tag", "lead", {"identity": "known"}),
            ("start: member of the group", "transition", {"state": "member"}),
        ):
            seen_s = self._seen(ready_s, kind, **fields)
            yield StatusRow(what, None, seen_s - ready_s, 10.0, "after ready")
        if not self._is_whole:
            return
        frames = self._run("timeout 3 candump -n 20 vcan0").output  # the kernel's own view
        if "7DF" not in frames or "7E8" not in frames:
            raise NotSeenError(f"candump shows no question and answer: {frames}")

    def warn(self) -> Iterator[StatusRow]:
        """The car ahead brakes."""
        yield StatusRow("the car ahead brakes: warned", None, self._warned_after(), 1.0)

    def kill(self) -> Iterator[StatusRow]:
        """`kill -9`, and what was recorded until then."""
        drive = self.newest_recording()
        yield self._restarted("kill -9", "KILL", BACK_S)
        yield self.open_recording("kill -9: recording opened", drive)

    def newest_recording(self) -> str:
        """The drive that is being recorded."""
        newest: str = self._run(f"ls -t {BOX}/*.mcap | head -1").output
        return newest.partition("Z-")[0] + "Z"

    def open_recording(self, what: str, drive: str) -> StatusRow:
        """As an engineer would."""
        answer = self._run(f"onboard export {drive}-*.mcap --candump /root/bus --pcap /root/air")
        frames, wsms = (int(line.split(": ")[1].split()[0]) for line in answer.output.splitlines())
        if frames < 10 or wsms < 10:
            raise NotSeenError(f"a recording with next to nothing in it: {answer.output}")
        return StatusRow(what, None, None, None, f"{frames} CAN frames and {wsms} WSMs in it")

    def hang(self) -> Iterator[StatusRow]:
        """A process that does nothing any more, and does not end."""
        yield self._restarted("hang (SIGSTOP)", "STOP", WATCHDOG_S + BACK_S)

    def take_bus(self) -> Iterator[StatusRow]:
        """The bus goes down for five seconds."""
        off, on = (
            ("ip link set vcan0 down", "ip link set vcan0 up")
            if self._is_whole
            else (f"echo bus {state} >{WORDS}; sleep 0.3" for state in ("off", "on"))
        )
        down_s = self._run(off).began_s
        lost_s = self._seen(down_s, "sensor_lost", sensor="speed")
        self._run("sleep 5")
        up_s = self._run(on).began_s
        back_s = self._seen(up_s, "sensor_recovered", sensor="speed")
        yield StatusRow("bus down, up after 5 s", lost_s - down_s, back_s - up_s, 3.0)

    def take_gpsd(self) -> Iterator[StatusRow]:
        """Gpsd is restarted."""
        down_s = self._run("systemctl stop gpsd.service gpsd.socket").began_s
        lost_s = self._seen(down_s, "sensor_lost", sensor="position")
        self._run("sleep 5")
        up_s = self._run("systemctl start gpsd.service").ended_s
        back_s = self._seen(up_s, "sensor_recovered", sensor="position")
        yield StatusRow("gpsd stopped, started after 5 s", lost_s - down_s, back_s - up_s, 10.0)

    def take_radio(self) -> Iterator[StatusRow]:
        """The radio unit is without power for ten seconds."""
        off_s = self._tell("radio off")
        left_s = self._seen(off_s, "transition", state="regular")
        self._run("sleep 5")
        on_s = self._tell("radio on")
        member_s = self._seen(on_s, "transition", state="member")
        yield StatusRow(
            "radio away", left_s - off_s, member_s - on_s, 5.0, "noticed: left the group"
        )

    def fill_disk(self) -> Iterator[StatusRow]:
        """Where the car writes, nothing more can be written."""
        filled_s = self._run(f"dd if=/dev/zero of={FOLDER}/full bs=64k", check=False).ended_s
        ended_s = self._logged(filled_s, "recorder", is_recording=False)
        warned_s = self._logged(told_s := self._tell("brake"), "warning")
        freed_s = self._run(f"rm {FOLDER}/full").ended_s
        again_s = self._logged(freed_s, "recorder", is_recording=True)
        yield StatusRow("disk full: recorded again", ended_s - filled_s, again_s - freed_s, 10.0)
        yield StatusRow("disk full: warned all the same", None, warned_s - told_s, 1.0)
        self._run("systemctl reload onboard")  # which begins the trace again
        self._seen(again_s, "transition", state="member")

    def step_clock(self) -> Iterator[StatusRow]:
        """Somebody sets the clock, ten minutes ahead."""
        stepped_s = self._run('date -s "+10 minutes"').ended_s
        self._run("sleep 5")
        member_s = max(
            (event["stamp_s"] for event in self._news() if event["kind"] == "transition"),
            default=stepped_s,
        )
        remark = "last change of membership; IDs follow UTC"
        yield StatusRow(
            "clock stepped by 10 minutes", None, max(0.0, member_s - stepped_s), 10.0, remark
        )
        yield StatusRow("clock stepped: warned", None, self._warned_after(), 1.0)

    def refuse_configuration(self) -> Iterator[StatusRow]:
        """A configuration with a mistake in it, then a good one."""
        self._run("cp /etc/onboard/car.yaml /root/good; echo oops: 1 >>/etc/onboard/car.yaml")
        self._run("systemctl reload onboard; sleep 2")
        status = self._run("systemctl show -p StatusText -p ActiveState onboard").output
        if "refused" not in status or "=active" not in status:
            raise NotSeenError(f"a bad configuration was not refused: {status}")
        good_s = self._run("cp /root/good /etc/onboard/car.yaml; systemctl reload onboard").began_s
        ready_s = self._seen(good_s, "ready")
        yield StatusRow("reload: bad one refused, good one taken", None, ready_s - good_s, 20.0)
        self._seen(good_s, "transition", state="member")

    def after_power_cut(self, drive: str) -> Iterator[StatusRow]:
        """The machine has been switched on again, and nobody has said anything to it.

        `drive` was being recorded when its power was cut.
        """
        # Until then the trace is that of the drive before.
        self._run("until systemctl is-active --quiet onboard; do sleep 0.2; done")
        ready_s = self._seen(0.0, "ready")
        remark = "the rig starts before the car, on the same box"
        yield StatusRow("power cut: ready after switching on", None, ready_s, BOOT_S, remark)
        member_s = self._seen(ready_s, "transition", state="member")
        yield StatusRow(
            "power cut: member of the group", None, member_s - ready_s, 10.0, "after ready"
        )
        yield self.open_recording("power cut: recording opened", drive)

    def stop(self) -> Iterator[StatusRow]:
        """In order."""
        took_s = self._run("systemctl stop onboard").took_s
        result = self._run("systemctl show -p Result -p ExecMainStatus onboard").output
        if "Result=success" not in result:
            raise NotSeenError(f"not stopped in order: {result}")
        yield StatusRow("stop", None, took_s, STOP_S)

    # ---- how it is seen ------------------------------------------------------------------

    def _restarted(self, what: str, signal: str, limit_s: float) -> StatusRow:
        pid = self._run("systemctl show -P MainPID onboard").output.strip()
        began_s = self._run(f"kill -{signal} {pid}").began_s
        gone = f"while [ $(systemctl show -P MainPID onboard) = {pid} ]; do sleep 0.05; done"
        gone_s = self._run(gone).ended_s
        ready_s = self._seen(began_s, "ready")
        member_s = self._seen(ready_s, "transition", state="member")
        remark = f"member of the group {member_s - ready_s:.1f} s later"
        return StatusRow(what, gone_s - began_s, ready_s - began_s, limit_s, remark)

    def _warned_after(self) -> float:
        told_s = self._tell("brake")
        return self._seen(told_s, "warning") - told_s

    def _tell(self, words: str) -> float:
        """Tell the car ahead; return when it heard."""
        self._run(f"echo {words} >{WORDS}; sleep 0.3")
        heard = self._run(f"journalctl -u rig -o cat | grep '{words}' | tail -1").output
        return float(heard.split()[0])

    def _logged(self, after_s: float, kind: str, **fields: object) -> float:
        """When, `after_s`, it happened as the journal says, which a full disk does not touch."""
        for _ in range(PATIENCE):
            for line in self._run("journalctl -u onboard -o cat -n 50").output.splitlines():
                record = json.loads(line) if line.startswith("{") else {}
                event = record.get("details", {})
                if _fits(event, after_s, kind, fields):
                    return float(event["stamp_s"])
            self._run(f"sleep {POLL_S}")
        raise NotSeenError(f"no {kind} {fields} in the journal after {after_s:.1f} s")

    def _seen(self, after_s: float, kind: str, **fields: object) -> float:
        """When, `after_s`, it first happened; waits for it."""
        for _ in range(PATIENCE):
            for event in self._news():
                if _fits(event, after_s, kind, fields):
                    return float(event["stamp_s"])
            self._run(f"sleep {POLL_S}")
        raise NotSeenError(f"no {kind} {fields} after {after_s:.1f} s")

    def _news(self) -> list[dict[str, Any]]:
        """All events since the daemon started last, which begins the trace anew."""
        command = f"stat -c %s {TRACE} && tail -c +{self._offset + 1} {TRACE}"
        size, _, text = self._run(command).output.partition("\n")
        if int(size) < self._offset:
            self._events, self._offset, self._rest = [], 0, ""
            return self._news()
        self._offset += len(text.encode())
        *lines, self._rest = (self._rest + text).split("\n")
        self._events += [json.loads(line) for line in lines]
        return self._events

    @property
    def _run(self) -> Callable[..., Any]:
        return self._machine.run


def _fits(event: dict[str, Any], after_s: float, kind: str, fields: dict[str, object]) -> bool:
    is_it = event.get("kind") == kind and event["stamp_s"] >= after_s
    return is_it and all(event.get(name) == value for name, value in fields.items())


LOOP = "for i in range(2000000): pass"


def slowness(machine: Machine | Here) -> float:
    """How many times longer the guest takes for a loop in Python than this machine."""
    timed = f"import timeit; print(timeit.timeit('{LOOP}', number=1))"
    return float(machine.run(f'python3 -c "{timed}"').output) / timeit.timeit(LOOP, number=1)
