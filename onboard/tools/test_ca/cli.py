"""`onboard keys`: certificates for tests and prototypes."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from onboard.errors import UserError
from onboard.security import key_files, p256
from onboard.security.certificates import Certificate
from onboard.security.credentials import Authority, Credentials
from onboard.security.file_signature import sign_file, signer_of_file
from onboard.security.its_time import to_time32
from onboard.security.pkcs11_token import Pkcs11Token
from onboard.security.plate_digest import PlateDigest
from onboard.settings import load_settings
from onboard.tools.command_line import command_line
from onboard.tools.test_ca import authority
from onboard.vehicle.config import CarConfig
from onboard.wave_udp import psid as psids

keys = command_line(
    "Make and show IEEE 1609.2 certificates. A root's, an authority's, and each vehicle's.",
    add_completion=False,
)

_BACKDATED_S = 3600.0
"""Certificates are valid from this long before now, for vehicles whose clocks are late."""

NewFolder = Annotated[Path, typer.Argument(help="The folder to create.")]
_NAME_BYTES = 255
"""Largest size of a certificate's `id`, a Hostname (IEEE 1609.2, 6.4.24)."""


def _valid_name(name: str) -> str:
    if not 0 < len(name.encode()) <= _NAME_BYTES:
        raise typer.BadParameter(f"empty, or longer than {_NAME_BYTES} octets")
    return name


Name = Annotated[str, typer.Option(help="Name in the certificate.", callback=_valid_name)]
Days = Annotated[float, typer.Option(min=0.01, max=3650, help="Validity in days.")]
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
    """Make the root certificate, which all vehicles of a trial trust."""
    made = authority.make_root(name, _numbers(psid), **_valid(days))
    key_files.write_authority(folder, made)
    _print(folder, made.credential.certificate)


@keys.command()
def issuing(
    folder: NewFolder,
    root: Annotated[Path, typer.Option(help="The folder of the root.")],
    name: Name = "prototype issuing",
    days: Days = 365,
) -> None:
    """Make the authority that issues the vehicles' certificates."""
    issuer = key_files.read_authority(root)
    if issuer.credential.certificate.issuer_id is not None:
        raise key_files.KeyFilesError(f"{root}: is no root; an authority must be issued by one")
    made = authority.make_issuing(issuer, name, **_valid(days))
    key_files.write_authority(folder, made)
    _print(folder, made.credential.certificate)


@keys.command()
def car(
    folder: NewFolder,
    *,
    issuing: Annotated[Path, typer.Option(help="The folder of the issuing authority.")],
    count: Annotated[
        int,
        typer.Option(
            min=1, max=1000, help="Number of certificates between which the vehicle changes."
        ),
    ] = 20,
    days: Days = 7,
    psid: Psids = None,
    implicit: Annotated[
        bool, typer.Option(help="Make implicit certificates, as the US SCMS does.")
    ] = False,
    config: Annotated[
        Path | None,
        typer.Option(
            help="The car's configuration: the certificates commit to the IDs of its plate;"
            " the keys are made in its `security.token`."
        ),
    ] = None,
) -> None:
    """Make the pseudonym certificates of one vehicle. It changes between them as it drives."""
    issuer = key_files.read_authority(issuing)
    if issuer.credential.certificate.issuer_id is None:
        raise key_files.KeyFilesError(
            f"{issuing}: is a root; pseudonyms need an authority (`onboard keys issuing`)"
        )
    settings = None if config is None else load_settings(config, CarConfig)
    token = None if settings is None else settings.security.token
    if token is not None and implicit:
        raise UserError(f"{config}: keys in its security.token need explicit certificates")
    if folder.exists():  # before a token is filled with keys
        raise key_files.KeyFilesError(f"{folder}: {key_files.EXISTS}")
    new_key = p256.new_key if token is None else Pkcs11Token(token).new_key
    valid = _valid(days)
    known = None if settings is None else _known_plate(settings, issuer)
    with _progress(known, valid) as plate:
        made = authority.make_pseudonyms(
            issuer,
            count,
            _numbers(psid),
            new_key=new_key,
            implicit=implicit,
            plate=plate,
            **valid,
        )
    key_files.write_credentials(folder, made)
    _print_pseudonyms(folder, made)
    last_utc_s = min(
        own.valid_until_utc_s for own in key_files.trusted(made, [folder] * len(made.pseudonyms))
    )
    if made.pseudonyms[0].certificate.subject.valid_until_utc_s > last_utc_s:
        typer.echo(
            f"{folder}: not valid for {days:g} days: an authority of {issuing} ends"
            f" {_utc(last_utc_s)}",
            err=True,
        )


@keys.command()
def revoke(
    file: Annotated[Path, typer.Argument(help="The revocation list to create.")],
    folders: Annotated[
        list[Path],
        typer.Argument(help="Vehicles, or authorities of a root: all that are revoked so far."),
    ],
    *,
    issuer: Annotated[Path, typer.Option(help="The folder of the authority that issued them.")],
    serial: Annotated[
        int, typer.Option(min=0, max=0xFFFF_FFFF, help="One more than that of the last list.")
    ] = 1,
    days: Days = 30,
) -> None:
    """Make a revocation list. Vehicles that have it in `crls` refuse what it names."""
    issuing = key_files.read_authority(issuer)
    own_id = issuing.credential.certificate.hashed_id8
    certificates = []
    for folder in folders:
        certificates += key_files.read_certificates(folder)
        if any(certificate.issuer_id != own_id for certificate in certificates):
            raise key_files.KeyFilesError(f"{folder}: was not issued by {issuer}")
    crl = authority.make_crl(
        issuing,
        certificates,
        serial=serial,
        issued_utc_s=time.time(),
        valid_for_s=days * authority.DAY_S,
    )
    key_files.write_crl(file, crl)
    typer.echo(f"{file}: revokes {len(certificates)} certificates")


@keys.command()
def sign(
    file: Annotated[Path, typer.Argument(help="The file, such as the hashes of a release.")],
    *,
    root: Annotated[Path, typer.Option(help="The folder of the root.")],
) -> None:
    """Sign a file; the signature is written into FILE.sig."""
    signer = key_files.read_authority(root).credential
    if signer.certificate.issuer_id is not None:
        raise key_files.KeyFilesError(f"{root}: is no root")
    signature = file.with_name(f"{file.name}.sig")
    try:
        signature.write_text(f"{sign_file(file.read_bytes(), signer)}\n", encoding="ascii")
    except OSError as error:
        raise UserError(f"{error.filename}: {error.strerror}") from error
    typer.echo(f"{signature}: signed by {signer.certificate.subject.name}")


@keys.command()
def verify(
    file: Annotated[Path, typer.Argument(help="The file.")],
    *,
    signature: Annotated[Path, typer.Option(help="Its signature, FILE.sig.")],
    trusted: Annotated[Path, typer.Option(help="Folder of keys: those of a vehicle.")],
) -> None:
    """Verify that a root which the vehicle trusts has signed a file."""
    roots = key_files.read_roots(trusted)
    try:
        content, signed = file.read_bytes(), signature.read_text("ascii", errors="replace")
    except OSError as error:
        raise UserError(f"{error.filename}: {error.strerror}") from error
    signer = signer_of_file(content, signed, roots)
    if signer is None:
        names = ", ".join(str(each.subject.name) for each in roots)
        raise UserError(f"{file}: not signed by a root of {trusted} ({names})")
    typer.echo(f"{file}: signed by {signer.subject.name}")


@keys.command()
def show(
    folder: Annotated[Path, typer.Argument(help="The folder of a vehicle or an authority.")],
) -> None:
    """Check a folder of keys, and list its certificates."""
    if key_files.is_authority(folder):
        authority = key_files.read_authority(folder)
        for certificate in authority.roots + authority.authorities:
            _print(folder, certificate)
        return
    credentials = key_files.read_credentials(folder)
    for certificate in credentials.roots + credentials.authorities:
        _print(folder, certificate)
    _print_pseudonyms(folder, credentials)


def _known_plate(settings: CarConfig, issuer: Authority) -> authority.KnownPlate:
    """Return the plate to which certificates of `issuer` commit.

    Raises:
        UserError: the issuer may grant no statements about vehicle IDs.
    """
    grants = issuer.credential.certificate.subject.issue_permissions
    if not any(settings.lcca_psid in grant.any_ssp for grant in grants):
        raise UserError(
            f"the authority {issuer.credential.certificate.subject.name} may not bind vehicle IDs"
            f" to certificates (PSID 0x{settings.lcca_psid:X} with any SSP): make a new root and"
            " authority, or leave out --config"
        )
    digest = PlateDigest(settings.security.plate_digest)
    return authority.KnownPlate(settings.car.plate, digest, settings.lcca_psid)


@contextmanager
def _progress(
    plate: authority.KnownPlate | None, valid: authority.Validity
) -> Iterator[authority.KnownPlate | None]:
    """Yield the same plate, with a progress bar of its IDs if stderr is a terminal."""
    if plate is None:
        yield None
        return
    hidden = not sys.stderr.isatty()
    with typer.progressbar(
        length=len(plate.epochs(valid)), label="vehicle IDs", file=sys.stderr, hidden=hidden
    ) as bar:
        yield replace(plate, derived=lambda: bar.update(1))


def _numbers(given: list[str] | None) -> list[int]:
    if not given:
        return sorted(psids.OF_VEHICLES)
    try:
        numbers = [int(text, 0) for text in given]
    except ValueError as error:
        raise typer.BadParameter("a PSID is a number, as 0x20", param_hint="--psid") from error
    if not all(0 <= number <= psids.HIGHEST for number in numbers):
        raise typer.BadParameter(f"a PSID is 0 to 0x{psids.HIGHEST:X}", param_hint="--psid")
    return numbers


def _valid(days: float) -> authority.Validity:
    since_utc_s = time.time() - _BACKDATED_S
    if to_time32(since_utc_s) < 0:
        raise UserError(
            "the clock shows a time before 2004: set it first, certificates depend on it"
        )
    return {
        "valid_from_utc_s": since_utc_s,
        "valid_for_s": days * authority.DAY_S + _BACKDATED_S,
    }


def _print_pseudonyms(folder: Path, credentials: Credentials) -> None:
    """Print each pseudonym with the time for which its whole chain is valid."""
    for pseudonym in key_files.trusted(credentials, [folder] * len(credentials.pseudonyms)):
        _print(
            folder, pseudonym.certificate, pseudonym.valid_from_utc_s, pseudonym.valid_until_utc_s
        )


def _print(
    folder: Path,
    certificate: Certificate,
    since_utc_s: float | None = None,
    until_utc_s: float | None = None,
) -> None:
    subject = certificate.subject
    since = _utc(since_utc_s or subject.valid_from_utc_s)
    until = _utc(until_utc_s or subject.valid_until_utc_s)
    name = subject.name or "pseudonym"
    typer.echo(f"{folder}: {certificate.hashed_id8.hex()} {name}, valid {since} to {until}")


def _utc(utc_s: float) -> str:
    return datetime.fromtimestamp(utc_s, UTC).isoformat(timespec="seconds")
