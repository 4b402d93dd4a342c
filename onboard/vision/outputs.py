"""Files that a command writes."""

import contextlib
from collections.abc import Iterable, Iterator
from pathlib import Path

from onboard.errors import UserError


def keep_inputs(inputs: Iterable[Path | None], outputs: Iterable[Path | None]) -> None:
    """See that no output would overwrite an input.

    Raises:
        UserError: one would.
    """
    read = [path for path in inputs if path is not None and path.exists()]
    for path in outputs:
        if path is not None and path.exists() and any(map(path.samefile, read)):
            raise UserError(f"{path}: is to be read and would be overwritten; write another file")


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Tell the user why `path` cannot be written.

    Raises:
        UserError: it cannot be.
    """
    try:
        yield
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise UserError(f"{path}: cannot be written: {why}") from error
