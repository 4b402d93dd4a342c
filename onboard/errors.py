"""Errors by whose fault they are: the user's, a sender's, or (every other exception) ours."""


class UserError(Exception):
    """A mistake in configuration, arguments or wiring; the message is one line for the user.

    The command line prints it and exits with 2.
    """


class DecodeError(ValueError):
    """Received bytes that cannot be decoded: the sender's fault, counted and dropped."""

    def __init__(self, reason: str, detail: str = "") -> None:
        """Take a short stable word, fit for a counter's label, and a sentence for people."""
        super().__init__(f"{reason}: {detail}" if detail else reason)
        self.reason = reason
        self.detail = detail
