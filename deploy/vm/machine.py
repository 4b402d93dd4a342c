"""A small Debian in QEMU without KVM, in which commands are run.

It has no network and no window: the test sends commands to the agent in the guest (`agent.py`) over
a virtio port. With counted instructions (`-icount shift=0`) the guest's clock advances one
nanosecond an instruction. So the guest is a machine of one core with 1,000 MIPS, about as fast as a
small board, independently of the load of the host.
"""

import json
import socket
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

MEMORY_MIB = 1536
HANG_TIMEOUT_S = 3000.0
"""Time of the host's clock after which a guest is considered hung."""
COUNTED_S, HOST_CLOCK_S = 120.0, 1500.0
"""Limit of a command, in guest time, and by the host's clock, which depends on its load."""
LONG_TIMEOUT = f"systemd.default_timeout_start_sec={HOST_CLOCK_S:.0f}"


class MachineError(Exception):
    """The guest does not respond, or a command in it failed."""


@dataclass(frozen=True, slots=True)
class Finished:
    """Result of a command, with times of the guest's monotonic clock."""

    code: int
    output: str
    began_s: float
    ended_s: float

    @property
    def took_s(self) -> float:
        """Duration in the guest's time."""
        return self.ended_s - self.began_s


class Machine:
    """One boot of the machine; its writes remain on its disks."""

    def __init__(
        self,
        image: Path,
        disks: tuple[Path, Path],
        share: Path,
        *,
        counted: bool,
        devices: Sequence[str] = (),
    ) -> None:
        """Switch on.

        Args:
            image: folder with the kernel and the initrd.
            disks: /dev/vda, qcow2, and /dev/vdb, raw; both are written to.
            share: folder of the host that the guest reads at /share.
            counted: whether the guest's clock counts instructions, instead of the host's clock.
            devices: options of QEMU for more of them.
        """
        disk, small_disk = disks
        self._address = disk.with_suffix(".agent")
        self._address.unlink(missing_ok=True)
        self._console = disk.with_suffix(".console").open("ab")
        clock = ["-icount", "shift=0", "-smp", "1"] if counted else ["-smp", "2"]
        kernel = f"console=ttyS0 root=/dev/vda rw quiet panic=-1 mitigations=off {LONG_TIMEOUT}"
        self._timeout_s = COUNTED_S if counted else HOST_CLOCK_S
        threads = "single" if counted else "multi"
        self._process = subprocess.Popen(
            [
                *("qemu-system-x86_64", "-machine", "q35", "-cpu", "max", *clock),
                *("-accel", f"tcg,thread={threads},tb-size=512", "-m", str(MEMORY_MIB)),
                *("-nodefaults", "-no-user-config", "-display", "none", "-no-reboot"),
                *("-kernel", str(image / "vmlinuz"), "-initrd", str(image / "initrd")),
                *("-append", kernel),
                *("-serial", "stdio", "-rtc", "clock=vm" if counted else "clock=host"),
                *("-drive", f"file={disk},format=qcow2,if=virtio"),
                *("-drive", f"file={small_disk},format=raw,if=virtio"),
                *("-device", "virtio-serial-pci"),
                *("-chardev", f"socket,id=agent,path={self._address},server=on,wait=off"),
                *("-device", "virtserialport,chardev=agent,name=host"),
                "-virtfs",
                f"local,path={share},mount_tag=share,security_model=none,readonly=on",
                *("-device", "virtio-rng-pci"),
                *devices,
            ],
            stdin=subprocess.DEVNULL,
            stdout=self._console,
            stderr=subprocess.STDOUT,
        )
        try:
            self._wire = self._connect()
            self._unread = b""
            self._read_line()
            self.run("mkdir -p /share; mount -t 9p -o trans=virtio,ro share /share")
        except BaseException:
            self._process.kill()
            raise

    def run(self, command: str, timeout_s: float | None = None, *, check: bool = True) -> Finished:
        """Run a command in the guest's bash as root.

        Args:
            command: of bash.
            timeout_s: limit in guest time; a default if None.
            check: raise an error if the exit code is not 0.

        Raises:
            MachineError: the command failed and `check` is set, or the guest does not respond.
        """
        request = {"command": command, "timeout_s": timeout_s or self._timeout_s}
        self._wire.sendall(json.dumps(request).encode() + b"\n")
        answer = Finished(**json.loads(self._read_line()))
        if check and answer.code != 0:
            raise MachineError(f"{command}: exit code {answer.code}: {answer.output[-2000:]}")
        return answer

    def cut_power(self) -> None:
        """Stop at once; writes that have not reached the disk are lost."""
        self._process.kill()
        self._close()

    def power_off(self) -> None:
        """Shut down properly."""
        self._wire.sendall(b'{"command": "systemctl --no-block poweroff", "timeout_s": 60}\n')
        self._process.wait(HANG_TIMEOUT_S)
        self._close()

    def _close(self) -> None:
        self._process.wait()
        self._wire.close()
        self._console.close()

    def _connect(self) -> socket.socket:
        wire = socket.socket(socket.AF_UNIX)
        wire.settimeout(HANG_TIMEOUT_S)
        while True:
            try:
                wire.connect(str(self._address))
            except OSError as error:
                if self._process.poll() is not None:
                    raise MachineError(f"QEMU ended; see {self._console.name}") from error
                time.sleep(0.05)
            else:
                return wire

    def _read_line(self) -> bytes:
        while b"\n" not in self._unread:
            try:
                data = self._wire.recv(65536)
            except TimeoutError as error:
                raise MachineError("the guest does not respond") from error
            if not data:
                raise MachineError(f"the guest has ended; see {self._console.name}")
            self._unread += data
        line, self._unread = self._unread.split(b"\n", 1)
        return line


def new_disk(disk: Path, base: Path, base_format: str) -> None:
    """Create a disk image on top of `base`, which is not changed.

    Args:
        disk: qcow2 image to create.
        base: image with the initial contents.
        base_format: of `base`, for example raw.
    """
    command = ["qemu-img", "create", "-q", "-f", "qcow2", "-F", base_format]
    subprocess.run([*command, "-b", base.resolve(), disk], check=True)
