"""The box itself: its clock, its disk, and the car's keys."""

import ctypes
import errno
import shutil
import tempfile
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

import onboard
from onboard.config import CarConfig
from onboard.security.key_files import KeyFilesError, read_credentials
from onboard.security.settings import PlateDigestSettings, SecuritySettings
from onboard.tools.doctor.finding import Finding, FindingLevel

DAY_S = 86_400.0
LEAST_FREE_BYTES, SCARCE_BYTES = 256 << 20, 2 << 30
LEAST_LEFT_S = DAY_S
"""Of the last pseudonym's life."""

SET_CLOCK = "`systemctl enable --now systemd-timesyncd`, or chrony fed by gpsd where no network is"
DELETE = "take old recordings away"
ELSEWHERE = "the folder must be there and belong to the user onboard"
NEW_KEYS = "`onboard keys car` makes new ones; see in-the-car.md"
UNSIGNED = "`onboard keys`, and name the folder in `security.keys_folder`; see in-the-car.md"
AGREE_ON_A_KEY = "agree on a `security.plate_digest.community_key` for your trial"

_STA_UNSYNC = 0x40
"""Status bit of adjtimex(2): nobody keeps the clock."""
_TIMEX_BYTES, _STATUS_AT = 208, 40
"""Size of struct timex and place of its status, on 64-bit Linux."""


def examine_clock(now_utc_s: float) -> Finding:
    """Signed messages are refused when clocks differ by more than seconds."""
    shown = datetime.fromtimestamp(now_utc_s, UTC).isoformat(sep=" ", timespec="seconds")
    if now_utc_s < Path(onboard.__file__).stat().st_mtime - DAY_S:
        before = f"{shown} UTC is before this program was installed"
        return Finding("clock", FindingLevel.MISSING, before, SET_CLOCK)
    if not _is_synchronised():
        return Finding("clock", FindingLevel.DOUBTFUL, f"{shown} UTC, not synchronised", SET_CLOCK)
    return Finding("clock", FindingLevel.GOOD, f"{shown} UTC, synchronised")


def _is_synchronised() -> bool:
    timex = ctypes.create_string_buffer(_TIMEX_BYTES)  # modes = 0: read only
    ctypes.CDLL(None).adjtimex(timex)
    status = int.from_bytes(timex.raw[_STATUS_AT : _STATUS_AT + 4], "little")
    return not status & _STA_UNSYNC


def written_folders(config: CarConfig) -> set[Path]:
    """Every folder that the car writes to."""
    files = (config.trace.file, config.trace.capture, config.access.driver_file)
    folders = {file.parent for file in files if file is not None}
    if config.recorder is not None:
        box = config.recorder.folder  # which the recorder makes
        folders.add(box if box.exists() else box.parent)
    return folders


def examine_disk(folders: Iterable[Path]) -> list[Finding]:
    """Free space where the car writes, and whether it can."""
    findings = [_folder(folder) for folder in sorted(folders)]
    return findings or [Finding("disk", FindingLevel.NOT_CONFIGURED, "nothing is recorded")]


def _folder(folder: Path) -> Finding:
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"?")
        free = shutil.disk_usage(folder).free
    except OSError as error:
        advice = DELETE if error.errno == errno.ENOSPC else ELSEWHERE
        return Finding("disk", FindingLevel.MISSING, f"{folder}: {error.strerror}", advice)
    return free_space(folder, free)


def free_space(folder: Path, free_bytes: int) -> Finding:
    """Whether that much is enough."""
    detail = f"{folder}: {free_bytes / 2**30:.1f} GiB free"
    if free_bytes < LEAST_FREE_BYTES:
        return Finding("disk", FindingLevel.MISSING, detail, DELETE)
    if free_bytes < SCARCE_BYTES:
        return Finding("disk", FindingLevel.DOUBTFUL, detail, DELETE)
    return Finding("disk", FindingLevel.GOOD, detail)


def examine_keys(security: SecuritySettings, now_utc_s: float) -> list[Finding]:
    """The certificates, for how long they last, and the secret of the plates."""
    findings = [_certificates(security.keys_folder, now_utc_s)]
    default = PlateDigestSettings().community_key
    if security.plate_digest.community_key == default:
        public = "plates are hidden by the key that everybody has"
        findings.append(Finding("keys", FindingLevel.DOUBTFUL, public, AGREE_ON_A_KEY))
    return findings


def _certificates(folder: Path | None, now_utc_s: float) -> Finding:
    if folder is None:
        unsigned = "messages go out unsigned, and anybody is believed"
        return Finding("keys", FindingLevel.DOUBTFUL, unsigned, UNSIGNED)
    try:
        pseudonyms = read_credentials(folder).pseudonyms
    except KeyFilesError as error:
        return Finding("keys", FindingLevel.MISSING, str(error), NEW_KEYS)
    subjects = [pseudonym.certificate.subject for pseudonym in pseudonyms]
    begins_s = min(subject.valid_from_utc_s for subject in subjects)
    ends_s = max(subject.valid_until_utc_s for subject in subjects)
    until = datetime.fromtimestamp(ends_s, UTC).isoformat(sep=" ", timespec="minutes")
    detail = f"{len(subjects)} pseudonyms, the last valid until {until}"
    if not begins_s <= now_utc_s < ends_s:
        return Finding("keys", FindingLevel.MISSING, f"{detail}: not now", NEW_KEYS)
    if ends_s - now_utc_s < LEAST_LEFT_S:
        return Finding("keys", FindingLevel.DOUBTFUL, detail, NEW_KEYS)
    return Finding("keys", FindingLevel.GOOD, detail)
