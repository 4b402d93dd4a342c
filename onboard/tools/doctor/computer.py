"""Tests of the computer: clock, disk, and the vehicle's keys."""

import csv
import ctypes
import errno
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path

import onboard
from onboard.recorder.build import present_build
from onboard.security.key_files import KeyFilesError, check_ids, read_own_credentials
from onboard.security.pkcs11_token import TokenError
from onboard.security.plate_digest import PlateDigest
from onboard.security.settings import PlateDigestSettings, SecuritySettings
from onboard.tools.doctor.finding import Finding, FindingLevel
from onboard.vehicle.config import CarConfig
from onboard.vision.camera_worker import NICENESS

DAY_S = 86_400.0
LEAST_FREE_BYTES, SCARCE_BYTES = 256 << 20, 2 << 30
"""Free space below which the disk counts as missing, and as doubtful."""
LEAST_LEFT_S = DAY_S
"""Remaining validity of the last pseudonym below which the keys are doubtful."""

SET_CLOCK = "`systemctl enable --now systemd-timesyncd`, or chrony with gpsd if there is no network"
DELETE = "delete old recordings"
ELSEWHERE = "the folder must exist and belong to the user onboard"
NEW_KEYS = "`onboard keys car` makes new ones; see in-the-car.md"
UNSIGNED = "`onboard keys`, and name the folder in `security.keys_folder`; see in-the-car.md"
AGREE_ON_A_KEY = "agree on a `security.plate_digest.community_key` for your trial"

CHRONYC = ("chronyc", "-c", "-n", "authdata")
SYSTEMCTL = ("systemctl", "show", "onboard.service", "--property=LoadState,Nice,CPUAffinity")
ANSWER_S = 2.0
"""Longest wait for the answer of another program."""
_AUTHDATA = 10
"""Fields of a source in the answer."""
_STA_UNSYNC = 0x40
"""Status bit of adjtimex(2): the clock is not synchronised."""
_TIMEX_BYTES, _STATUS_AT = 208, 40
"""Size of struct timex and offset of its status, on 64-bit Linux."""


def examine_program() -> Finding:
    """Return which build this is, and with which priority its service runs."""
    detail = f"onboard {present_build().name}{service_priority(_answer(SYSTEMCTL))}"
    return Finding("program", FindingLevel.GOOD, detail)


def service_priority(properties: str) -> str:
    """Return with which priority and where the service and its camera's process run.

    Args:
        properties: of `systemctl show`, a line `NAME=value` each; without a service, nothing is
            returned.
    """
    values = dict(line.split("=", 1) for line in properties.splitlines() if "=" in line)
    if values.get("LoadState") != "loaded":
        return ""
    niceness, processors = int(values["Nice"]), values["CPUAffinity"] or "all"
    return (
        f", niceness {niceness}, its camera {max(niceness, NICENESS)}, on processors: {processors}"
    )


def examine_clock(now_utc_s: float) -> Finding:
    """Test the clock: receivers refuse signed messages whose time is wrong by some seconds."""
    text = datetime.fromtimestamp(now_utc_s, UTC).isoformat(sep=" ", timespec="seconds")
    if now_utc_s < Path(onboard.__file__).stat().st_mtime - DAY_S:
        before = f"{text} UTC is before this program was installed"
        return Finding("clock", FindingLevel.MISSING, before, SET_CLOCK)
    if not _is_synchronised():
        return Finding("clock", FindingLevel.DOUBTFUL, f"{text} UTC, not synchronised", SET_CLOCK)
    authentication = _authentication()
    return Finding("clock", FindingLevel.GOOD, f"{text} UTC, synchronised{authentication}")


def _authentication() -> str:
    """Return what chrony, if it runs and answers this user, says of its sources' authentication."""
    authdata = _answer(CHRONYC)
    return f", {nts_sources(authdata)}" if authdata else ""


def _answer(command: Sequence[str]) -> str:
    """Return what a program answers; nothing if there is no such program, or it fails."""
    try:
        return subprocess.run(  # noqa: S603 (a constant)
            command, capture_output=True, text=True, timeout=ANSWER_S, check=True
        ).stdout
    except (OSError, subprocess.SubprocessError):
        return ""


def nts_sources(authdata: str) -> str:
    """Return how many sources of time are authenticated by Network Time Security (RFC 8915).

    Args:
        authdata: of `chronyc -c authdata`, a line a source: name, mode, key ID, type and length,
            seconds since the last key exchange, attempts, NAKs, cookies, length of a cookie.
    """
    sources = [fields for fields in csv.reader(authdata.splitlines()) if len(fields) == _AUTHDATA]
    nts = sum(mode == "NTS" and cookies != "0" for _, mode, *_, cookies, _length in sources)
    return f"{nts} of {len(sources)} sources authenticated (NTS)"


def _is_synchronised() -> bool:
    timex = ctypes.create_string_buffer(_TIMEX_BYTES)  # modes = 0: read only
    ctypes.CDLL(None).adjtimex(timex)
    status = int.from_bytes(timex.raw[_STATUS_AT : _STATUS_AT + 4], "little")
    return not status & _STA_UNSYNC


def written_folders(config: CarConfig) -> set[Path]:
    """Return every folder that the daemon writes to."""
    files = (config.trace.file, config.trace.capture, config.access.driver_file)
    folders = {file.parent for file in files if file is not None}
    if config.recorder is not None:
        folder = config.recorder.folder  # The recorder creates it.
        folders.add(folder if folder.exists() else folder.parent)
    return folders


def examine_disk(folders: Iterable[Path]) -> list[Finding]:
    """Test that each folder can be written to, and its free space."""
    findings = [_folder(folder) for folder in sorted(folders)]
    return findings or [Finding("disk", FindingLevel.NOT_CONFIGURED, "nothing is written")]


def _folder(folder: Path) -> Finding:
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"?")
        free = shutil.disk_usage(folder).free
    except OSError as error:
        advice = DELETE if error.errno == errno.ENOSPC else ELSEWHERE
        return Finding("disk", FindingLevel.MISSING, f"{folder}: {error.strerror}", advice)
    return examine_free_space(folder, free)


def examine_free_space(folder: Path, free_bytes: int) -> Finding:
    """Compare the free space of a folder with the limits."""
    detail = f"{folder}: {free_bytes / 2**30:.1f} GiB free"
    if free_bytes < LEAST_FREE_BYTES:
        return Finding("disk", FindingLevel.MISSING, detail, DELETE)
    if free_bytes < SCARCE_BYTES:
        return Finding("disk", FindingLevel.DOUBTFUL, detail, DELETE)
    return Finding("disk", FindingLevel.GOOD, detail)


def examine_keys(security: SecuritySettings, plate: str, now_utc_s: float) -> list[Finding]:
    """Test the certificates, their plate, their validity at `now_utc_s`, and the community key."""
    findings = [_certificates(security, plate, now_utc_s)]
    default = PlateDigestSettings().community_key
    if security.plate_digest.community_key == default:
        public = "the community key is the public default, so plates are not secret"
        findings.append(Finding("keys", FindingLevel.DOUBTFUL, public, AGREE_ON_A_KEY))
    return findings


def _certificates(security: SecuritySettings, plate: str, now_utc_s: float) -> Finding:
    try:
        credentials = read_own_credentials(security, plate)
        if credentials is not None and credentials.commit_to_ids and security.keys_folder:
            check_ids(security.keys_folder, plate, PlateDigest(security.plate_digest))
    except (KeyFilesError, TokenError) as error:
        return Finding("keys", FindingLevel.MISSING, str(error), NEW_KEYS)
    if credentials is None:
        unsigned = "messages are sent unsigned, and unsigned messages are accepted"
        return Finding("keys", FindingLevel.DOUBTFUL, unsigned, UNSIGNED)
    subjects = [pseudonym.certificate.subject for pseudonym in credentials.pseudonyms]
    begins_s = min(subject.valid_from_utc_s for subject in subjects)
    ends_s = max(subject.valid_until_utc_s for subject in subjects)
    valid_until = datetime.fromtimestamp(ends_s, UTC).isoformat(sep=" ", timespec="minutes")
    detail = f"{len(subjects)} pseudonyms, the last valid until {valid_until}"
    if not begins_s <= now_utc_s < ends_s:
        return Finding("keys", FindingLevel.MISSING, f"{detail}, none valid now", NEW_KEYS)
    if ends_s - now_utc_s < LEAST_LEFT_S:
        return Finding("keys", FindingLevel.DOUBTFUL, detail, NEW_KEYS)
    return Finding("keys", FindingLevel.GOOD, detail)
