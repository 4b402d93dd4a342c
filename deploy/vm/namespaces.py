"""The same box in namespaces of this machine, with its own systemd as PID 1.

Needs root and a kernel with cgroup 2. Faults that concern the kernel itself (vcan, the clock, a
loss of power) are not tested here, since they would affect this machine.
"""

import shutil
import subprocess
import time
from pathlib import Path

from deploy.vm.machine import COUNTED_S, Finished, MachineError

BOOT = """
set -e
mount --make-rprivate /
mount -o loop,ro,noload "$1/disk.raw" "$2/lower"
if [ "$4" = read-only ]; then
    mount -t overlay overlay -o "lowerdir=$2/upper:$2/lower" "$2/root"  # without an upper one
else
    mount -t overlay overlay -o "lowerdir=$2/lower,upperdir=$2/upper,workdir=$2/work" "$2/root"
fi
cd "$2/root"
if [ "$4" = read-only ]; then
    for place in opt/onboard etc/onboard var/lib/onboard; do
        mkdir -p "$2/partition/$place"
        cp -aT "$2/upper/$place" "$2/partition/$place"
        mount --bind "$2/partition/$place" "$place"
    done
    for place in tmp var/tmp; do mount -t tmpfs tmpfs "$place"; done
fi
mount -t proc proc proc
mount --bind -o ro proc/sys proc/sys
mount -t sysfs -o ro sysfs sys
mount -t cgroup2 cgroup2 sys/fs/cgroup
mount -t tmpfs tmpfs run
mount -t tmpfs tmpfs dev
for device in null zero full random urandom; do
    touch "dev/$device"; mount --bind "/dev/$device" "dev/$device"
done
mkdir dev/shm
ln -s /proc/self/fd dev/fd
mkdir -p share var/lib/onboard/drive old  # all there already where the root is read-only
mount --bind -o ro "$3" share
mount -t tmpfs -o size=48m tmpfs var/lib/onboard/drive
ip link set lo up
pivot_root . old
umount -l old
exec env -i container=vm-test /sbin/init
"""
PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
NAMESPACE_OPTIONS = ("--pid", "--mount", "--uts", "--ipc", "--net", "--cgroup")


def new_folder(folder: Path) -> None:
    """Empty the folder of a box, whose first boot will be of the disk image as it is."""
    shutil.rmtree(folder, ignore_errors=True)
    for name in ("lower", "upper", "work", "root"):
        (folder / name).mkdir(parents=True)


class Namespaces:
    """Like `Machine`, in namespaces of this machine."""

    def __init__(
        self, image: Path, folder: Path, share: Path, *, is_root_read_only: bool = False
    ) -> None:
        """Boot.

        Args:
            image: folder of the disk image.
            folder: of all writes, of `new_folder` or an earlier boot.
            share: folder of this machine that the box sees as /share.
            is_root_read_only: of an installed box, whose program, configuration and data are then
                on a partition that can be written.

        Raises:
            MachineError: systemd does not start.
        """
        self._unshare = subprocess.Popen(
            [
                *("unshare", "--fork", "--kill-child", *NAMESPACE_OPTIONS),
                *("sh", "-c", BOOT, "boot", image, folder, share),
                "read-only" if is_root_read_only else "writable",
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        children = Path(f"/proc/{self._unshare.pid}/task/{self._unshare.pid}/children")
        give_up_at = time.monotonic() + 60.0
        while True:
            self.init = children.read_text().strip()
            """Process ID of its systemd."""
            if self.init and self._is_up():
                return
            if time.monotonic() > give_up_at:
                self._unshare.kill()
                raise MachineError("systemd does not start in namespaces; is this root?")
            time.sleep(0.1)

    def _is_up(self) -> bool:
        # Not `is-system-running`, which waits for a release to be proven.
        state = self.run("systemctl is-active multi-user.target", check=False).output.strip()
        return state == "active"

    def run(self, command: str, timeout_s: float | None = None, *, check: bool = True) -> Finished:
        """Run a command in bash as root.

        Args:
            command: of bash.
            timeout_s: limit; a default if None.
            check: raise an error if the exit code is not 0.

        Raises:
            MachineError: the command failed and `check` is set.
        """
        began_s = time.monotonic()
        done = subprocess.run(
            [
                *("nsenter", "--target", self.init, "--all", "--root", "--wd"),
                *("env", "-i", f"PATH={PATH}", "/bin/bash", "-c", command),
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=timeout_s or COUNTED_S,
            check=False,
        )
        answer = Finished(done.returncode, done.stdout, began_s, time.monotonic())
        if check and answer.code != 0:
            raise MachineError(f"{command}: exit code {answer.code}: {answer.output[-2000:]}")
        return answer

    def cut_power(self) -> None:
        """End every process in the namespaces."""
        self._unshare.kill()
        self._unshare.wait()
        while Path("/proc", self.init).exists():  # until its mounts are gone
            time.sleep(0.05)
