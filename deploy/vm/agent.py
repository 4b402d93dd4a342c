#!/usr/bin/python3
"""Runs in the guest: receives commands as JSON lines, and returns their results as JSON lines.

Times are of the guest's monotonic clock.
"""

import json
import os
import subprocess
import time

PORT = "/dev/virtio-ports/host"


def main() -> None:
    """Execute commands until the machine is switched off."""
    while not os.path.exists(PORT):  # noqa: PTH110 (the guest has nothing but its own Python)
        time.sleep(0.1)
    with open(PORT, "r+b", buffering=0) as port:  # noqa: PTH123
        port.write(b'{"agent": "here"}\n')
        unread = b""
        while True:
            unread += port.read(4096) or b""
            while b"\n" in unread:
                line, unread = unread.split(b"\n", 1)
                rest = json.dumps(answer(json.loads(line))).encode() + b"\n"
                while rest:  # the port accepts only part of a long answer at a time
                    rest = rest[port.write(rest) or 0 :]
            time.sleep(0.01)


def answer(request: dict[str, object]) -> dict[str, object]:
    """Run a command in bash; returns exit code, both outputs as one text, and times."""
    began_s = time.monotonic()
    try:
        done = subprocess.run(
            ["/bin/bash", "-c", str(request["command"])],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=float(str(request["timeout_s"])),
            check=False,
        )
        code, output = done.returncode, done.stdout
    except subprocess.TimeoutExpired as expired:
        code, output = 124, expired.stdout or b""
    return {
        "code": code,
        "output": output.decode("utf-8", "replace"),
        "began_s": began_s,
        "ended_s": time.monotonic(),
    }


if __name__ == "__main__":
    main()
