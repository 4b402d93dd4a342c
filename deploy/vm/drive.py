"""The faults that the test injects into the box, and the expected results, in the guest's time."""

import json
import re
import timeit
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from deploy.vm.machine import Machine
from deploy.vm.namespaces import Namespaces

FOLDER = "/var/lib/onboard/drive"
"""Mount point of a small second disk."""
TRACE = f"{FOLDER}/trace.jsonl"
BOX = f"{FOLDER}/box"
"""Folder of the black box."""
COMMANDS = "/dev/udp/127.0.0.1/5397"
"""Port of the rig's commands, in the notation of bash."""
DEAD_RELEASE = """set -e
onboard-releases proven
cd /opt/onboard/releases
cp -a "$(basename "$(readlink ../current)")" dead
echo 'exit 1' >dead/venv/bin/onboard
onboard-releases switch dead
"""
OCB = """set -e
modprobe mac80211_hwsim radios=2
for radio in wlan0 wlan1; do
    iw dev $radio set type ocb
    ip link set $radio up
    iw dev $radio ocb join 5180 10MHZ
done
cat >/etc/systemd/system/onboard.service.d/ocb.conf <<'UNIT'
[Service]
AmbientCapabilities=CAP_NET_RAW CAP_NET_ADMIN
CapabilityBoundingSet=CAP_NET_RAW CAP_NET_ADMIN
RestrictAddressFamilies=AF_PACKET
PrivateUsers=no
UNIT
cp /etc/onboard/car.yaml /root/good
cp /share/car-ocb.yaml /etc/onboard/car.yaml
systemctl daemon-reload
"""
"""Two radios whose frames the kernel's 802.11 passes to each other. Its regulatory rules disable
5.9 GHz, which is that of a car."""
NO_OCB = """set -e
cp /root/good /etc/onboard/car.yaml
rm /etc/systemd/system/onboard.service.d/ocb.conf
systemctl daemon-reload
systemctl restart rig onboard
"""
POLL_S, POLLS = 0.5, 120
"""Interval in guest time at which the trace is read, and how often at most."""

RESTART_S = 5.0
"""Limit from the end of the daemon to the next one's being ready."""
BOOT_S = 120.0
"""Limit from power-on to ready, most of which is Debian's boot on the guest's slow processor."""
FALL_BACK_S = 15.0
"""Limit from the start of a release that ends at its start, until the good one is ready."""
WATCHDOG_S = 2.0
STOP_S = 2.0


@dataclass(frozen=True, slots=True)
class StatusRow:
    """Result of one fault: a line of the table."""

    fault: str
    detected_s: float | None
    """Time from the fault to its report in the trace."""
    recovered_s: float | None
    """Time from the end of the fault until everything was as before."""
    limit_s: float | None
    """Limit of `recovered_s`."""
    remark: str = ""

    @property
    def is_kept(self) -> bool:
        """Whether the limit was kept."""
        if self.limit_s is None:
            return True
        return self.recovered_s is not None and self.recovered_s <= self.limit_s


class NotSeenError(Exception):
    """An expected event did not occur."""


class VmDrive:
    """Injects faults into the box, and reads its trace."""

    def __init__(self, machine: Machine | Namespaces) -> None:
        self._machine = machine
        self._has_kernel = isinstance(machine, Machine)
        self._events: list[dict[str, Any]] = []
        self._offset = 0
        self._rest = ""

    def steps(self) -> Sequence[Callable[[], Iterator[StatusRow]]]:
        """All steps in their order; the daemon is running after the last."""
        anywhere = [
            self.start,
            self.warn,
            self.kill,
            self.hang,
            self.stop_bus,
            self.stop_gpsd,
            self.switch_radio_off,
            self.fill_disk,
            self.refuse_configuration,
            self.fall_back,
        ]
        return [*anywhere, self.use_ocb, self.step_clock] if self._has_kernel else anywhere

    # ---- faults --------------------------------------------------------------------------

    def start(self) -> Iterator[StatusRow]:
        """`systemctl start`: time to ready, and from then to the last of the first outputs."""
        began_s = self._run("systemctl start onboard").began_s
        ready_s = self._time_of(began_s, "ready")
        yield StatusRow("start: ready", None, ready_s - began_s, RESTART_S)
        firsts: dict[str, dict[str, object]] = {
            "speed": {},
            "position": {},
            "lead": {"identity": "known"},
            "transition": {"state": "member"},
        }
        last_s = max(self._time_of(ready_s, kind, **fields) for kind, fields in firsts.items())
        what = "start: speed, position, lead vehicle, group"
        yield StatusRow(what, None, last_s - ready_s, 10.0, "after ready")
        if not self._has_kernel:
            return
        frames = self._run("timeout 3 candump -n 20 vcan0").output  # the kernel's own view
        if "7DF" not in frames or "7E8" not in frames:
            raise NotSeenError(f"candump shows no request and response: {frames}")

    def warn(self) -> Iterator[StatusRow]:
        """The lead vehicle brakes."""
        yield StatusRow("lead vehicle brakes: warned", None, self._warned_after(), 1.0)

    def kill(self) -> Iterator[StatusRow]:
        """`kill -9`, after which the recording until then must be readable."""
        drive = self.newest_recording()
        yield self._restarted("kill -9", "KILL", RESTART_S)
        yield self.open_recording("kill -9: recording opened", drive)

    def newest_recording(self) -> str:
        """Path prefix of the current recording."""
        newest: str = self._run(f"ls -t {BOX}/*.mcap | head -1").output
        return newest.partition("Z-")[0] + "Z"

    def open_recording(self, what: str, drive: str) -> StatusRow:
        """Export a recording.

        Raises:
            NotSeenError: it contains too few frames or messages.
        """
        answer = self._run(f"onboard export {drive}-*.mcap --candump /tmp/bus --pcap /tmp/air")
        found = {unit: int(n) for n, unit in re.findall(r": (\d+) (frames|WSMs)", answer.output)}
        frames, wsms = found.get("frames", 0), found.get("WSMs", 0)
        if frames < 10 or wsms < 10:
            raise NotSeenError(f"the recording is almost empty: {answer.output}")
        return StatusRow(what, None, None, None, f"{frames} CAN frames and {wsms} WSMs in it")

    def hang(self) -> Iterator[StatusRow]:
        """A process that hangs."""
        yield self._restarted("hang (SIGSTOP)", "STOP", WATCHDOG_S + RESTART_S)

    def stop_bus(self) -> Iterator[StatusRow]:
        """The CAN bus is down for five seconds."""
        off, on = (
            ("ip link set vcan0 down", "ip link set vcan0 up")
            if self._has_kernel
            else (f"echo bus {state} >{COMMANDS}; sleep 0.3" for state in ("off", "on"))
        )
        down_s = self._run(off).began_s
        lost_s = self._time_of(down_s, "sensor_lost", sensor="speed")
        self._run("sleep 5")
        up_s = self._run(on).began_s
        back_s = self._time_of(up_s, "sensor_recovered", sensor="speed")
        yield StatusRow("bus down, up after 5 s", lost_s - down_s, back_s - up_s, 3.0)

    def stop_gpsd(self) -> Iterator[StatusRow]:
        """Gpsd is restarted."""
        down_s = self._run("systemctl stop gpsd.service gpsd.socket").began_s
        lost_s = self._time_of(down_s, "sensor_lost", sensor="position")
        self._run("sleep 5")
        up_s = self._run("systemctl start gpsd.service").ended_s
        back_s = self._time_of(up_s, "sensor_recovered", sensor="position")
        yield StatusRow("gpsd stopped, started after 5 s", lost_s - down_s, back_s - up_s, 10.0)

    def switch_radio_off(self) -> Iterator[StatusRow]:
        """The radio unit is without power for ten seconds."""
        off_s = self._send("radio off")
        left_s = self._time_of(off_s, "transition", state="regular")
        self._run("sleep 5")
        on_s = self._send("radio on")
        member_s = self._time_of(on_s, "transition", state="member")
        yield StatusRow(
            "radio unit off", left_s - off_s, member_s - on_s, 5.0, "detected: left the group"
        )

    def fill_disk(self) -> Iterator[StatusRow]:
        """The disk of trace and recorder is full."""
        filled_s = self._run(f"dd if=/dev/zero of={FOLDER}/full bs=64k", check=False).ended_s
        ended_s = self._logged_time_of(filled_s, "recorder", is_recording=False)
        warned_s = self._logged_time_of(sent_s := self._send("brake"), "warning")
        freed_s = self._run(f"rm {FOLDER}/full").ended_s
        again_s = self._logged_time_of(freed_s, "recorder", is_recording=True)
        yield StatusRow("disk full: recorded again", ended_s - filled_s, again_s - freed_s, 10.0)
        yield StatusRow("disk full: warned", None, warned_s - sent_s, 1.0)
        self._run("systemctl reload onboard")  # starts a new trace
        self._time_of(again_s, "transition", state="member")

    def step_clock(self) -> Iterator[StatusRow]:
        """The clock is set ten minutes ahead."""
        stepped_s = self._run('date -s "+10 minutes"').ended_s
        self._run("sleep 5")
        member_s = max(
            (event["stamp_s"] for event in self._read_trace() if event["kind"] == "transition"),
            default=stepped_s,
        )
        remark = "last change of membership; IDs follow UTC"
        yield StatusRow(
            "clock stepped by 10 minutes", None, max(0.0, member_s - stepped_s), 10.0, remark
        )
        yield StatusRow("clock stepped: warned", None, self._warned_after(), 1.0)

    def use_ocb(self) -> Iterator[StatusRow]:
        """Both vehicles' radios are 802.11p of the guest's kernel (`endpoint: raw`)."""
        self._run(OCB)
        self._send("radio ocb")
        began_s = self._run("systemctl restart onboard").began_s
        try:
            member_s = self._time_of(self._time_of(began_s, "ready"), "transition", state="member")
            what = "OCB: member of the group"
            yield StatusRow(what, None, member_s - began_s, 15.0, "after restart")
            yield StatusRow("OCB: warned", None, self._warned_after(), 1.0)
        finally:
            again_s = self._run(NO_OCB).began_s
        self._time_of(self._time_of(again_s, "ready"), "transition", state="member")

    def refuse_configuration(self) -> Iterator[StatusRow]:
        """An invalid configuration, then a valid one."""
        self._run("cp /etc/onboard/car.yaml /root/good; echo oops: 1 >>/etc/onboard/car.yaml")
        self._run("systemctl reload onboard; sleep 2")
        status = self._run("systemctl show -p StatusText -p ActiveState onboard").output
        if "refused" not in status or "=active" not in status:
            raise NotSeenError(f"an invalid configuration was not refused: {status}")
        good_s = self._run("cp /root/good /etc/onboard/car.yaml; systemctl reload onboard").began_s
        ready_s = self._time_of(good_s, "ready")
        yield StatusRow("reload: invalid refused, valid accepted", None, ready_s - good_s, 20.0)
        self._time_of(good_s, "transition", state="member")

    def fall_back(self, where: str = "") -> Iterator[StatusRow]:
        """An update to a release that ends at its start, while the one in use is good."""
        self._run(DEAD_RELEASE)
        began_s = self._run("systemctl restart --no-block onboard").began_s
        ready_s = self._time_of(began_s, "ready")
        releases = self._run("onboard-releases list").output
        if "dead  failed" not in releases or "current, good" not in releases:
            raise NotSeenError(f"the good release is not in use: {releases}")
        what = f"{where}update to a release that ends at its start"
        yield StatusRow(what, None, ready_s - began_s, FALL_BACK_S, "the good one is ready")

    def after_power_cut(self, drive: str) -> Iterator[StatusRow]:
        """The machine has been switched on again after a power cut.

        `drive` is the recording that was interrupted.
        """
        # Until then the trace is the previous one.
        self._run("until systemctl is-active --quiet onboard; do sleep 0.2; done")
        ready_s = self._time_of(0.0, "ready")
        yield StatusRow("power cut: ready after power-on", None, ready_s, BOOT_S)
        member_s = self._time_of(ready_s, "transition", state="member")
        yield StatusRow(
            "power cut: member of the group", None, member_s - ready_s, 10.0, "after ready"
        )
        yield self.open_recording("power cut: recording opened", drive)

    def use_read_only_root(self) -> Iterator[StatusRow]:
        """The box, whose root is read-only now, is installed again, started and warned."""
        if self._run("touch /etc/written", check=False).code == 0:
            raise NotSeenError("the root can be written")
        self._run("sh /share/box/install.sh --vcan; systemctl stop onboard")
        began_s = self._run("systemctl start onboard").began_s
        ready_s = self._time_of(began_s, "ready")
        yield StatusRow("read-only root: ready", None, ready_s - began_s, RESTART_S)
        self._time_of(ready_s, "transition", state="member")
        yield StatusRow("read-only root: warned", None, self._warned_after(), 1.0)
        self._run("systemctl stop onboard")
        drive = self.newest_recording()
        yield self.open_recording("read-only root: recording opened", drive)

    def stop(self) -> Iterator[StatusRow]:
        """`systemctl stop`."""
        took_s = self._run("systemctl stop onboard").took_s
        result = self._run("systemctl show -p Result -p ExecMainStatus onboard").output
        if "Result=success" not in result:
            raise NotSeenError(f"did not stop properly: {result}")
        yield StatusRow("stop", None, took_s, STOP_S)

    # ---- observation ---------------------------------------------------------------------

    def _restarted(self, what: str, signal: str, limit_s: float) -> StatusRow:
        pid = self._run("systemctl show -P MainPID onboard").output.strip()
        began_s = self._run(f"kill -{signal} {pid}").began_s
        gone = f"while [ $(systemctl show -P MainPID onboard) = {pid} ]; do sleep 0.05; done"
        gone_s = self._run(gone).ended_s
        ready_s = self._time_of(began_s, "ready")
        member_s = self._time_of(ready_s, "transition", state="member")
        remark = f"member of the group {member_s - ready_s:.1f} s later"
        return StatusRow(what, gone_s - began_s, ready_s - began_s, limit_s, remark)

    def _warned_after(self) -> float:
        sent_s = self._send("brake")
        return self._time_of(sent_s, "warning") - sent_s

    def _send(self, command: str) -> float:
        """Send a command to the rig; returns when the rig received it."""
        self._run(f"echo {command} >{COMMANDS}; sleep 0.3")
        received = self._run(f"journalctl -u rig -o cat | grep '{command}' | tail -1").output
        return float(received.split()[0])

    def _logged_time_of(self, after_s: float, kind: str, **fields: object) -> float:
        """Time of the first such event after `after_s` in the journal, which is on another disk."""
        for _ in range(POLLS):
            for line in self._run("journalctl -u onboard -o cat -n 50").output.splitlines():
                record = json.loads(line) if line.startswith("{") else {}
                event = record.get("details", {})
                if _fits(event, after_s, kind, fields):
                    return float(event["stamp_s"])
            self._run(f"sleep {POLL_S}")
        raise NotSeenError(f"no {kind} {fields} in the journal after {after_s:.1f} s")

    def _time_of(self, after_s: float, kind: str, **fields: object) -> float:
        """Time of the first such event after `after_s` in the trace; waits for it."""
        for _ in range(POLLS):
            for event in self._read_trace():
                if _fits(event, after_s, kind, fields):
                    return float(event["stamp_s"])
            self._run(f"sleep {POLL_S}")
        raise NotSeenError(f"no {kind} {fields} after {after_s:.1f} s")

    def _read_trace(self) -> list[dict[str, Any]]:
        """All events since the last start of the daemon, which begins a new trace."""
        command = f"stat -c %s {TRACE} && tail -c +{self._offset + 1} {TRACE}"
        size, _, text = self._run(command).output.partition("\n")
        if int(size) < self._offset:
            self._events, self._offset, self._rest = [], 0, ""
            return self._read_trace()
        self._offset += len(text.encode())
        *lines, self._rest = (self._rest + text).split("\n")
        self._events += [json.loads(line) for line in lines]
        return self._events

    @property
    def _run(self) -> Callable[..., Any]:
        return self._machine.run


def _fits(event: dict[str, Any], after_s: float, kind: str, fields: dict[str, object]) -> bool:
    matches = event.get("kind") == kind and event["stamp_s"] >= after_s
    return matches and all(event.get(name) == value for name, value in fields.items())


LOOP = "for i in range(2000000): pass"


def slowness(machine: Machine | Namespaces) -> float:
    """Run time of a Python loop in the guest relative to this machine."""
    timed = f"import timeit; print(timeit.timeit('{LOOP}', number=1))"
    return float(machine.run(f'python3 -c "{timed}"').output) / timeit.timeit(LOOP, number=1)
