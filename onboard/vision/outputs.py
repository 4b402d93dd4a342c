"""Output files of commands."""

import contextlib
from collections.abc import Iterable, Iterator
from pathlib import Path

from onboard.errors import UserError


def keep_inputs(inputs: Iterable[Path | None], outputs: Iterable[Path | None]) -> None:
    """Check that no output overwrites an input.

    Raises:
        UserError: one does.
    """
    read = [path for path in inputs if path is not None and path.exists()]
    for path in outputs:
        if path is not None and path.exists() and any(map(path.samefile, read)):
            raise UserError(f"{path}: is an input and would be overwritten; write another file")


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Convert errors of writing `path` to a `UserError` that names it.

    Raises:
        UserError: writing failed.
    """
    try:
        yield
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise UserError(f"{path}: cannot be written: {why}") from error
