#!/usr/bin/python3
"""Runs in the guest: a JSON line asks for a command, a JSON line says what came of it.

Stamps are of the guest's monotonic clock: the time that a car would have seen.
"""

import json
import os
import subprocess
import time

PORT = "/dev/virtio-ports/host"


def main() -> None:
    """Answer until the machine is switched off."""
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
                while rest:  # the port takes some of a long answer at a time
                    rest = rest[port.write(rest) or 0 :]
            time.sleep(0.01)


def answer(asked: dict[str, object]) -> dict[str, object]:
    """Run a command by bash; what it writes to both outputs comes back as one text."""
    began_s = time.monotonic()
    try:
        done = subprocess.run(
            ["/bin/bash", "-c", str(asked["command"])],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=float(str(asked["timeout_s"])),
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
