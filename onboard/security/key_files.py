"""Keys and certificates on disk, in folders that only their owner can open.

    CAR/pseudonyms/000.cert, 000.key, 000.ids, ...      AUTHORITY/own.cert, own.key
    CAR/crls/*.crl
    both: roots/*.cert, authorities/*.cert

Certificates and revocation lists are encoded as in IEEE 1609.2, keys as PKCS #8 PEM; a car's keys
may be in a token instead (`pkcs11_token.py`). `.ids` has the leaves of the vehicle IDs that a
certificate commits to (`id_commitment.py`), where it does. The cars of another trial are trusted
once its certificates are in `roots` and `authorities`.
"""

import os
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)

from onboard.errors import UserError
from onboard.security import p256
from onboard.security.certificate_codec import decode_certificate
from onboard.security.certificates import Certificate
from onboard.security.credentials import Authority, Credential, Credentials
from onboard.security.id_commitment import leaf, leaves_in, root_in, ssp_of
from onboard.security.oer import Malformed, Unsupported
from onboard.security.pkcs11_token import Pkcs11Key, Pkcs11Token
from onboard.security.plate_digest import PlateDigest
from onboard.security.private_file import exposure
from onboard.security.rejection import NotTrusted
from onboard.security.secured_crl import load_crl, trust_store
from onboard.security.settings import SecuritySettings
from onboard.security.trust import Trusted, TrustStore

EXISTS = "exists; remove it, or name another folder"
"""What is said of a folder of keys that is to be made."""


class KeyFilesError(UserError):
    """Unusable files; the message names the file and the remedy."""


def write_credentials(folder: Path, credentials: Credentials) -> None:
    """Write the credentials of one car into `folder`, which must not exist.

    Raises:
        KeyFilesError: it exists or cannot be written, or receivers would refuse the certificates.
    """
    trusted(credentials, [folder] * len(credentials.pseudonyms))
    _new_folder(folder)
    _write_trusted(folder, credentials.roots, credentials.authorities)
    pseudonyms = folder / "pseudonyms"
    _new_folder(pseudonyms)
    for i, credential in enumerate(credentials.pseudonyms):
        _write_credential(pseudonyms, f"{i:03}", credential)
    if credentials.crls:
        _new_folder(folder / "crls")
    for i, crl in enumerate(credentials.crls):
        write_crl(folder / "crls" / f"{i:03}.crl", crl)


def read_credentials(
    folder: Path, psids: Collection[int] = (), token: Pkcs11Token | None = None
) -> Credentials:
    """Read what `write_credentials` wrote.

    Args:
        folder: the folder of a car.
        psids: services in which it sends.
        token: has the private keys that are not in the folder.

    Raises:
        KeyFilesError: something is missing, damaged, inconsistent, or readable by others, or the
            certificates do not permit these services.
        TokenError: a key is neither in the folder nor in the token.
    """
    _require_private(folder)
    pseudonyms = folder / "pseudonyms"
    _require_private(pseudonyms)
    names = sorted(path.stem for path in pseudonyms.glob("*.cert"))
    if not names:
        raise KeyFilesError(f"{pseudonyms}: no certificate; make some with `onboard keys car`")
    crls = sorted((folder / "crls").glob("*.crl"))
    credentials = Credentials(
        tuple(_read_credential(pseudonyms, name, token) for name in names),
        *_read_trusted(folder),
        tuple(_read(crl) for crl in crls),
    )
    files = [pseudonyms / f"{name}.cert" for name in names]
    _check_crls(credentials, crls)
    checked = trusted(credentials, files)
    for file, own, credential in zip(files, checked, credentials.pseudonyms, strict=True):
        if own.key != credential.key.public_key():
            raise KeyFilesError(f"{file.with_suffix('.key')}: is not the key of {file.name}")
        missing = ", ".join(f"0x{psid:X}" for psid in sorted(set(psids) - own.psids))
        if missing:
            raise KeyFilesError(f"{file}: does not allow PSID {missing}; make some with --psid")
    return credentials


def read_own_credentials(
    security: SecuritySettings, plate: str, psids: Collection[int] = ()
) -> Credentials | None:
    """Read the credentials that a car's settings name; `None` if they name none.

    Raises:
        KeyFilesError, TokenError: as `read_credentials`, the token cannot be opened, or the
            certificates commit to the IDs of another plate or community key.
    """
    if security.keys_folder is None:
        return None
    token = None if security.token is None else Pkcs11Token(security.token)
    credentials = read_credentials(security.keys_folder, psids, token)
    if credentials.commit_to_ids:
        first = credentials.pseudonyms[0].certificate
        digest = PlateDigest(security.plate_digest)
        epoch = digest.epoch(first.subject.valid_from_utc_s)
        committed = [own.committed for own in credentials.pseudonyms]
        _check_id_of(epoch, committed, security.keys_folder, plate, digest)
    return credentials


def check_ids(folder: Path, plate: str, digest: PlateDigest) -> None:
    """Check that each of a car's certificates commits to its IDs; their keys may be elsewhere.

    Of those with one validity, each has one of as many epochs from its beginning; where there are
    fewer epochs, some have none.

    Args:
        folder: the folder of the car.
        plate: its plate.
        digest: derives the IDs.

    Raises:
        KeyFilesError: they commit to those of another plate or community key, or to none.
    """
    by_begin: dict[float, list[tuple[bytes, ...]]] = {}
    for file in sorted((folder / "pseudonyms").glob("*.cert")):
        certificate = _read_certificate(file)
        begin = by_begin.setdefault(certificate.subject.valid_from_utc_s, [])
        begin.append(_read_committed(file.with_suffix(".ids"), certificate))
    for begins_utc_s, committed in by_begin.items():
        epochs = max(1, sum(map(len, committed)))
        for later in range(min(len(committed), epochs)):
            epoch = digest.epoch(begins_utc_s) + later
            _check_id_of(epoch, committed, folder, plate, digest)


def _check_id_of(
    epoch: int,
    committed: Sequence[tuple[bytes, ...]],
    folder: Path,
    plate: str,
    digest: PlateDigest,
) -> None:
    its_leaf = leaf(epoch, digest.car_id(plate, digest.begins_at(epoch)))
    if not any(its_leaf in each for each in committed):
        file = folder / "pseudonyms" / f"{epoch % len(committed):03}.cert"
        raise KeyFilesError(
            f"{file}: commits to the IDs of another vehicle than {plate} (`car.plate`), or of"
            " another `security.plate_digest` (`community_key`, `epoch_s`, `scrypt_log2_n`), or to"
            " none; make certificates with `onboard keys car --config`"
        )


def trusted(credentials: Credentials, files: Iterable[Path]) -> list[Trusted]:
    """Verify the chain of each pseudonym, as a receiver does.

    Raises:
        KeyFilesError: a chain is not valid; the message names the pseudonym's file of `files`.
    """
    checked = []
    store: TrustStore | None = None
    for file, own in zip(files, credentials.pseudonyms, strict=True):
        try:
            store = store or trust_store(credentials)
            checked.append(store.receive_certificate(own.certificate))
        except NotTrusted as refusal:
            raise KeyFilesError(f"{file}: {refusal}") from refusal
        store.keep(checked[-1])
        if store.is_revoked(checked[-1]):
            raise KeyFilesError(f"{file}: revoked")
    return checked


def _check_crls(credentials: Credentials, files: Iterable[Path]) -> None:
    for file, crl in zip(files, credentials.crls, strict=True):
        try:
            load_crl(crl, TrustStore(credentials.roots, credentials.authorities))
        except NotTrusted as refusal:
            raise KeyFilesError(f"{file}: {refusal}") from refusal


def write_crl(file: Path, crl: bytes) -> None:
    """Write a signed revocation list. Raises `KeyFilesError` if the file exists."""
    _write(file, crl)


def read_certificates(folder: Path) -> list[Certificate]:
    """Return the certificates that are issued to a vehicle or to an authority.

    Raises:
        KeyFilesError: there are none, or they cannot be read.
    """
    files = sorted((folder / "pseudonyms").glob("*.cert")) or [folder / "own.cert"]
    return [_read_certificate(file) for file in files]


def write_authority(folder: Path, authority: Authority) -> None:
    """Write the keys of an authority into `folder`, which must not exist.

    Raises:
        KeyFilesError: it exists or cannot be written.
    """
    _new_folder(folder)
    _write_trusted(folder, authority.roots, authority.authorities)
    _write_credential(folder, "own", authority.credential)


def is_authority(folder: Path) -> bool:
    """Whether the folder is that of an authority: it has a certificate of its own."""
    return (folder / "own.cert").exists()


def read_authority(folder: Path) -> Authority:
    """Read what `write_authority` wrote.

    Raises:
        KeyFilesError: as `read_credentials`.
    """
    _require_private(folder)
    own = _read_credential(folder, "own")
    if p256.compressed(own.key.public_key()) != own.certificate.subject.public_key:
        raise KeyFilesError(f"{folder / 'own.key'}: is not the key of own.cert")
    return Authority(own, *_read_trusted(folder))


def read_roots(folder: Path) -> tuple[Certificate, ...]:
    """Return the roots that a vehicle or an authority trusts.

    Raises:
        KeyFilesError: there are none, or they cannot be read.
    """
    return _read_trusted(folder)[0]


def _write_trusted(
    folder: Path, roots: Iterable[Certificate], authorities: Iterable[Certificate]
) -> None:
    for name, certificates in (("roots", roots), ("authorities", authorities)):
        _new_folder(folder / name)
        for certificate in certificates:
            file = folder / name / f"{certificate.hashed_id8.hex()}.cert"
            _write(file, certificate.encoded)


def _read_trusted(folder: Path) -> tuple[tuple[Certificate, ...], tuple[Certificate, ...]]:
    roots, authorities = (
        tuple(_read_certificate(path) for path in sorted((folder / name).glob("*.cert")))
        for name in ("roots", "authorities")
    )
    if not roots:
        raise KeyFilesError(f"{folder / 'roots'}: no certificate; no message could be verified")
    return roots, authorities


def _write_credential(folder: Path, name: str, credential: Credential) -> None:
    _write(folder / f"{name}.cert", credential.certificate.encoded)
    if credential.committed:
        _write(folder / f"{name}.ids", b"".join(credential.committed))
    if isinstance(credential.key, Pkcs11Key):
        return
    pem = credential.key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    _write(folder / f"{name}.key", pem)


def _read_credential(folder: Path, name: str, token: Pkcs11Token | None = None) -> Credential:
    certificate = _read_certificate(folder / f"{name}.cert")
    committed = _read_committed(folder / f"{name}.ids", certificate)
    file = folder / f"{name}.key"
    public_key = certificate.subject.public_key
    if token is not None and public_key is not None and not file.exists():
        return Credential(certificate, token.key_of(p256.public_key(public_key)), committed)
    _require_private(file)
    try:
        key = load_pem_private_key(_read(file), password=None)
    except ValueError as error:
        raise KeyFilesError(f"{file}: no private key in PEM") from error
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise KeyFilesError(f"{file}: is not the key of {name}.cert")
    return Credential(certificate, key, committed)


def _read_committed(file: Path, certificate: Certificate) -> tuple[bytes, ...]:
    """Read the leaves that a certificate commits to; none if it commits to nothing."""
    ssps = [permission.ssp for permission in certificate.subject.permissions]
    if not file.exists() and not any(map(root_in, ssps)):
        return ()
    leaves = leaves_in(_read(file))
    if not leaves or ssp_of(leaves) not in ssps:
        raise KeyFilesError(
            f"{file}: is not of {file.stem}.cert; make both with `onboard keys car`"
        )
    return leaves


def _read_certificate(file: Path) -> Certificate:
    try:
        return decode_certificate(_read(file))
    except (Malformed, Unsupported) as error:
        raise KeyFilesError(f"{file}: no 1609.2 certificate that can be used: {error}") from error


def _new_folder(folder: Path) -> None:
    try:
        folder.mkdir(mode=0o700)
    except FileExistsError:
        raise KeyFilesError(f"{folder}: {EXISTS}") from None
    except FileNotFoundError:
        raise KeyFilesError(
            f"{folder}: needs the folder {folder.parent}: mkdir -p -m 700 {folder.parent}"
        ) from None
    except OSError as error:
        raise KeyFilesError(f"{folder}: cannot be made: {error.strerror}") from error


def _write(file: Path, content: bytes) -> None:
    """Write a new file that others can never read. Raises `KeyFilesError` if it exists."""
    try:
        descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "wb") as opened:
            opened.write(content)
    except OSError as error:
        raise KeyFilesError(f"{file}: cannot be written: {error.strerror}") from error


def _read(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise KeyFilesError(f"{file}: cannot be read: {error.strerror}") from error


def _require_private(path: Path) -> None:
    try:
        exposed = exposure(path)
    except OSError as error:
        remedy = "; `onboard keys` makes it" if isinstance(error, FileNotFoundError) else ""
        raise KeyFilesError(f"{path}: cannot be read: {error.strerror}{remedy}") from error
    if exposed is not None:
        raise KeyFilesError(exposed)
