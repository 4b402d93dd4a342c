"""An asyncio loop that can be asked between two of its turns whether input waits."""

import asyncio
import select
import selectors


class PolledLoop(asyncio.SelectorEventLoop):
    """The loop of the daemon, whose long steps end where a wire has input."""

    def __init__(self) -> None:
        """Open the loop."""
        selector = selectors.EpollSelector()
        super().__init__(selector)
        self._poll = select.poll()
        # A set of polled files is readable while one of its files is (epoll(7)).
        self._poll.register(selector.fileno(), select.POLLIN)

    def has_input(self) -> bool:
        """Whether a file or socket that the loop reads has input, or a thread a call for it."""
        return bool(self._poll.poll(0))
