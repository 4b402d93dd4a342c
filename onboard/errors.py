"""Errors of the user and of senders; every other exception is an error of the program."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:  # pydantic takes longer to import than most commands to run
    from pydantic import ValidationError


class UserError(Exception):
    """A mistake in configuration, arguments or wiring; the message is one line for the user.

    The command line prints it and exits with 2.
    """


class DecodeError(ValueError):
    """Received bytes that cannot be decoded: an error of the sender, counted and dropped."""

    def __init__(self, reason: str, detail: str = "") -> None:
        """Take a short stable word, fit for a counter's label, and a sentence for people."""
        super().__init__(f"{reason}: {detail}" if detail else reason)
        self.reason = reason
        self.detail = detail


def first_mistake(error: "ValidationError") -> str:
    """Return where the first mistake in received data is, and what it is, without the data."""
    first = error.errors(include_url=False, include_context=False, include_input=False)[0]
    return f"{'.'.join(map(str, first['loc']))}: {first['msg']}".lstrip(": ")
