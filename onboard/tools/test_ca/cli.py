"""`onboard keys`: certificates for tests and prototypes."""

import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from onboard import psid as psids
from onboard.errors import UserError
from onboard.security import key_files
from onboard.security.certificates import Certificate
from onboard.security.credentials import Credentials
from onboard.security.its_time import to_time32
from onboard.tools.test_ca import authority

keys = typer.Typer(
    help="Make and show IEEE 1609.2 certificates: a root, an authority, and those of each car.",
    no_args_is_help=True,
)

_CLOCKS_DIFFER_S = 3600.0
"""Certificates hold from so long before now."""

NewFolder = Annotated[Path, typer.Argument(help="The new folder to make.")]
_LONGEST_NAME = 255
"""Octets of a certificate's `id`, a Hostname (IEEE 1609.2, 6.4.24)."""


def _fits(name: str) -> str:
    if not 0 < len(name.encode()) <= _LONGEST_NAME:
        raise typer.BadParameter(f"empty, or longer than {_LONGEST_NAME} octets")
    return name


Name = Annotated[str, typer.Option(help="Name in the certificate.", callback=_fits)]
Days = Annotated[float, typer.Option(min=0.01, max=3650, help="How many days it is valid.")]
Psids = Annotated[
    list[str] | None,
    typer.Option("--psid", help="A service (PSID) that may be used, as 0x20. [BSM and LCCA]"),
]


@keys.command()
def root(
    folder: NewFolder,
    name: Name = "prototype root",
    days: Days = 3650,
    psid: Psids = None,
) -> None:
    """Make the root certificate, which all cars of a trial trust."""
    made = authority.make_root(name, _numbers(psid), **_valid(days))
    key_files.write_authority(folder, made)
    _tell(folder, made.credential.certificate)


@keys.command()
def issuing(
    folder: NewFolder,
    root: Annotated[Path, typer.Option(help="The folder of the root.")],
    name: Name = "prototype issuing",
    days: Days = 365,
) -> None:
    """Make the authority that issues the cars' certificates."""
    above = key_files.read_authority(root)
    if above.credential.certificate.issuer_id is not None:
        raise key_files.KeyFilesError(f"{root}: is no root, and authorities stand right below one")
    made = authority.make_issuing(above, name, **_valid(days))
    key_files.write_authority(folder, made)
    _tell(folder, made.credential.certificate)


@keys.command()
def car(
    folder: NewFolder,
    issuing: Annotated[Path, typer.Option(help="The folder of the issuing authority.")],
    count: Annotated[
        int, typer.Option(min=1, max=1000, help="How many certificates the car uses in turn.")
    ] = 20,
    days: Days = 7,
    psid: Psids = None,
) -> None:
    """Make the pseudonym certificates of one car, which it changes between as it drives."""
    issuer = key_files.read_authority(issuing)
    if issuer.credential.certificate.issuer_id is None:
        raise key_files.KeyFilesError(
            f"{issuing}: is a root; a car takes what `onboard keys issuing` makes"
        )
    made = authority.make_pseudonyms(issuer, count, _numbers(psid), **_valid(days))
    key_files.write_credentials(folder, made)
    _tell_pseudonyms(folder, made)


@keys.command()
def show(folder: Annotated[Path, typer.Argument(help="The folder of a car.")]) -> None:
    """Check the folder of a car and list its certificates."""
    credentials = key_files.read_credentials(folder)
    for certificate in credentials.roots + credentials.authorities:
        _tell(folder, certificate)
    _tell_pseudonyms(folder, credentials)


def _numbers(given: list[str] | None) -> list[int]:
    if not given:
        return [psids.BSM, psids.LCCA]
    try:
        numbers = [int(text, 0) for text in given]
    except ValueError as error:
        raise typer.BadParameter("a PSID is a number, as 0x20", param_hint="--psid") from error
    if not all(0 <= number <= psids.HIGHEST for number in numbers):
        raise typer.BadParameter(f"a PSID is 0 to 0x{psids.HIGHEST:X}", param_hint="--psid")
    return numbers


def _valid(days: float) -> authority.Validity:
    since_utc_s = time.time() - _CLOCKS_DIFFER_S
    if to_time32(since_utc_s) < 0:
        raise UserError("the clock stands before 2004: set it first, certificates go by it")
    return {
        "valid_from_utc_s": since_utc_s,
        "valid_for_s": days * authority.DAY_S + _CLOCKS_DIFFER_S,
    }


def _tell_pseudonyms(folder: Path, credentials: Credentials) -> None:
    """Each with the time in which its whole chain holds."""
    for own in key_files.trusted(credentials, [folder] * len(credentials.pseudonyms)):
        _tell(folder, own.certificate, own.valid_from_utc_s, own.valid_until_utc_s)


def _tell(
    folder: Path,
    certificate: Certificate,
    since_utc_s: float | None = None,
    until_utc_s: float | None = None,
) -> None:
    subject = certificate.subject
    since, until = (
        datetime.fromtimestamp(utc_s, UTC).isoformat(timespec="seconds")
        for utc_s in (
            since_utc_s or subject.valid_from_utc_s,
            until_utc_s or subject.valid_until_utc_s,
        )
    )
    name = subject.name or "pseudonym"
    typer.echo(f"{folder}: {certificate.hashed_id8.hex()} {name}, valid {since} to {until}")
