"""Files and folders of secrets, which only their owner may use."""

from pathlib import Path

_OTHERS = 0o077


def exposure(path: Path) -> str | None:
    """Return who may use the secret and what to do about it; `None` if only its owner may.

    Raises:
        OSError: it cannot be looked at.
    """
    mode = path.stat().st_mode & 0o777
    if not mode & _OTHERS:
        return None
    return f"{path}: others may use it (mode {mode:o}); chmod {mode & ~_OTHERS:o} it"
