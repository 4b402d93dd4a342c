"""Errors of the user and of senders; every other exception is an error of the program."""


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
