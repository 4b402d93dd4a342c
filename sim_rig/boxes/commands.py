"""Runs a command of the user's for a box, such as one that copies its recording."""

import asyncio
import tempfile
from collections.abc import Sequence
from typing import IO

from onboard.errors import UserError


async def run_command(what: str, command: Sequence[str], within_s: float) -> None:
    """Run a command without a shell; what it starts in the background may run on.

    Args:
        what: the setting, and the car if needed, for the error.
        command: program and arguments.
        within_s: limit of its duration, s.

    Raises:
        UserError: it cannot be run, is not done in time, or fails; the text has the last line that
            it printed.
    """
    with tempfile.TemporaryFile() as output:
        process = await start_command(what, command, output)
        try:
            await asyncio.wait_for(process.wait(), within_s)
        except TimeoutError:
            raise UserError(f"{what}: not done after {within_s:g} s") from None
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
        output.seek(0)
        printed = output.read()
    if process.returncode != 0:
        raise failure(what, command, process.returncode, printed)


async def start_command(
    what: str, command: Sequence[str], output: IO[bytes]
) -> asyncio.subprocess.Process:
    """Start a command that writes to `output`; for arguments and errors, see `run_command`."""
    try:
        return await asyncio.create_subprocess_exec(
            *command, stdin=asyncio.subprocess.DEVNULL, stdout=output, stderr=output
        )
    except OSError as error:
        raise UserError(f"{what}: {command[0]}: {error.strerror}") from error


def failure(what: str, command: Sequence[str], code: int | None, printed: bytes) -> UserError:
    """Return the error of a command that failed, with the last line that it printed."""
    lines = [line for line in printed.decode(errors="replace").split("\n") if line.strip()]
    last = f": {lines[-1].strip()}" if lines else ""
    return UserError(f"{what}: {' '.join(command)}: exit code {code}{last}")
