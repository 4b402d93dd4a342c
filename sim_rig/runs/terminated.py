"""Runs a live testbench until it is done, or terminated with all of its processes."""

import asyncio
import signal
from collections.abc import Coroutine
from typing import TypeVar

import typer

_Result = TypeVar("_Result")


def run_until_terminated(work: Coroutine[None, None, _Result]) -> _Result:
    """Run `work`; SIGTERM cancels it, so that its child processes end too.

    Raises:
        typer.Exit: it was terminated.
    """

    async def cancelled_by_signal() -> _Result:
        task = asyncio.current_task()
        assert task is not None  # noqa: S101 (inside of asyncio.run there is one)
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
        return await work

    try:
        return asyncio.run(cancelled_by_signal())
    except asyncio.CancelledError:
        raise typer.Exit(128 + signal.SIGTERM) from None
