"""Whose fault it is: the user's mistakes have one base class, everything else is ours."""


class UserError(Exception):
    """A mistake in configuration, arguments or wiring; the message is one line for the user.

    The command line prints it and exits with 2.
    """
