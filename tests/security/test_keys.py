"""`onboard keys`: the files it writes are usable, by their owner only."""

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from onboard.errors import UserError
from onboard.security import ieee1609dot2, key_files
from onboard.security.security_services import NotTrusted, SecurityServices
from onboard.tools.test_ca.authority import make_crl
from onboard.tools.test_ca.cli import keys
from tests.security.trial import ALICE, BOB, BSM, ISSUING, LCCA, UTC_S


def _run(*arguments: int | Path | str) -> Result:
    return CliRunner().invoke(keys, [str(argument) for argument in arguments])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A root, an issuing authority and two cars, made by the commands."""
    for arguments in (
        ("root", tmp_path / "root"),
        ("issuing", tmp_path / "issuing", "--root", tmp_path / "root"),
        ("car", tmp_path / "a", "--issuing", tmp_path / "issuing", "--count", 3),
        ("car", tmp_path / "b", "--issuing", tmp_path / "issuing", "--count", 1, "--psid", "0x20"),
    ):
        result = _run(*arguments)
        assert result.exit_code == 0, result.output
    return tmp_path


def test_cars_with_keys_made_by_the_commands_verify_each_other(folder: Path) -> None:
    a, b = (
        SecurityServices(time.time(), key_files.read_credentials(folder / name))
        for name in ("a", "b")
    )
    assert b.open(a.secure(b"x", LCCA, now=0.0), LCCA, now=0.1).payload == b"x"
    assert a.open(b.secure(b"y", BSM, now=0.0), BSM, now=0.1).payload == b"y"


def test_other_users_cannot_open_the_key_files(folder: Path) -> None:
    paths = [path for top in ("root", "issuing", "a", "b") for path in (folder / top).rglob("*")]
    assert {path.stat().st_mode & 0o777 for path in paths if path.is_file()} == {0o600}
    assert {path.stat().st_mode & 0o777 for path in paths if path.is_dir()} == {0o700}


def test_cars_with_implicit_and_explicit_certificates_verify_each_other(folder: Path) -> None:
    made = _run("car", folder / "c", "--issuing", folder / "issuing", "--implicit", "--count", 2)
    assert made.exit_code == 0, made.output
    a, c = (
        SecurityServices(time.time(), key_files.read_credentials(folder / name, (BSM, LCCA)))
        for name in ("a", "c")
    )
    assert a.open(c.secure(b"x", LCCA, now=0.0), LCCA, now=0.1).payload == b"x"
    assert c.open(a.secure(b"y", LCCA, now=0.0), LCCA, now=0.1).payload == b"y"


def test_the_key_of_another_implicit_certificate_is_an_error(folder: Path) -> None:
    _run("car", folder / "c", "--issuing", folder / "issuing", "--implicit", "--count", 2)
    pseudonyms = folder / "c" / "pseudonyms"
    (pseudonyms / "000.key").write_bytes((pseudonyms / "001.key").read_bytes())
    with pytest.raises(UserError, match=r"000\.key: is not the key of 000\.cert"):
        key_files.read_credentials(folder / "c")


def test_the_key_of_another_authority_is_an_error(folder: Path) -> None:
    (folder / "issuing" / "own.key").write_bytes((folder / "root" / "own.key").read_bytes())
    with pytest.raises(UserError, match=r"own\.key: is not the key of own\.cert"):
        key_files.read_authority(folder / "issuing")


# ---- revocation ---------------------------------------------------------------------------------


@pytest.fixture
def crl(folder: Path) -> Path:
    """A list that revokes vehicle b."""
    made = _run("revoke", folder / "b.crl", folder / "b", "--issuer", folder / "issuing")
    assert made.exit_code == 0, made.output
    assert made.output.endswith("b.crl: revokes 1 certificates\n")
    return folder / "b.crl"


def _install(crl: Path, car: Path) -> None:
    (car / "crls").mkdir()
    (car / "crls" / crl.name).write_bytes(crl.read_bytes())


def test_a_revoked_vehicle_is_refused_by_those_who_have_the_list(folder: Path, crl: Path) -> None:
    b = SecurityServices(time.time(), key_files.read_credentials(folder / "b"))
    _install(crl, folder / "a")
    a = SecurityServices(time.time(), key_files.read_credentials(folder / "a"))
    with pytest.raises(NotTrusted, match=r"^revoked$"):
        a.open(b.secure(b"x", BSM, now=0.0), BSM, now=0.0)


def test_a_revoked_vehicle_does_not_start_with_the_list(folder: Path, crl: Path) -> None:
    _install(crl, folder / "b")
    with pytest.raises(UserError, match=r"000\.cert: revoked"):
        key_files.read_credentials(folder / "b")


def test_an_authority_is_revoked_by_its_root(folder: Path) -> None:
    made = _run("revoke", folder / "i.crl", folder / "issuing", "--issuer", folder / "root")
    assert made.exit_code == 0, made.output
    _install(folder / "i.crl", folder / "a")
    with pytest.raises(UserError, match=r"000\.cert: revoked"):
        key_files.read_credentials(folder / "a")


def test_lists_are_written_and_read_back(tmp_path: Path, folder: Path, crl: Path) -> None:
    _install(crl, folder / "a")
    read = key_files.read_credentials(folder / "a")
    assert read.crls == (crl.read_bytes(),)
    key_files.write_credentials(tmp_path / "copy", read)
    assert key_files.read_credentials(tmp_path / "copy").crls == read.crls


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"", "malformed"),
        (ieee1609dot2.encode_unsecured(b"list"), "unsigned"),
        (make_crl(ISSUING, (), serial=1, issued_utc_s=UTC_S, valid_for_s=60.0), "unknown_cert"),
    ],
    ids=["empty", "unsigned", "of another trial"],
)
def test_a_list_that_is_not_trusted_is_an_error_that_names_the_file(
    folder: Path, content: bytes, what: str
) -> None:
    (folder / "bad.crl").write_bytes(content)
    _install(folder / "bad.crl", folder / "a")
    with pytest.raises(UserError, match=rf"crls/bad\.crl: {what}"):
        key_files.read_credentials(folder / "a")


def test_only_the_issuer_of_a_vehicle_revokes_it(folder: Path) -> None:
    result = _run("revoke", folder / "x.crl", folder / "b", "--issuer", folder / "root")
    assert isinstance(result.exception, UserError)
    assert "was not issued by" in str(result.exception)
    assert not (folder / "x.crl").exists()


# ---- files --------------------------------------------------------------------------------------


def test_show_lists_every_certificate_and_no_key(folder: Path) -> None:
    result = _run("show", folder / "a")
    assert result.exit_code == 0
    assert len(result.output.splitlines()) == 5
    assert result.output.count("pseudonym, valid") == 3
    assert "PRIVATE" not in result.output


@pytest.mark.parametrize(("name", "certificates"), [("root", 1), ("issuing", 2)])
def test_show_lists_the_certificates_of_an_authority(
    folder: Path, name: str, certificates: int
) -> None:
    result = _run("show", folder / name)
    assert result.exit_code == 0
    assert len(result.output.splitlines()) == certificates
    assert "prototype root, valid" in result.output
    assert "PRIVATE" not in result.output


def test_what_was_written_is_read_back(tmp_path: Path) -> None:
    key_files.write_credentials(tmp_path / "alice", ALICE)
    read = key_files.read_credentials(tmp_path / "alice")
    assert [own.certificate for own in read.pseudonyms] == [
        own.certificate for own in ALICE.pseudonyms
    ]
    assert [own.key.private_numbers() for own in read.pseudonyms] == [
        own.key.private_numbers() for own in ALICE.pseudonyms
    ]
    assert (read.roots, read.authorities) == (ALICE.roots, ALICE.authorities)


def _mode(mode: int) -> Callable[..., Any]:
    return lambda path: path.chmod(mode)


@pytest.mark.parametrize(
    ("file", "damage", "what"),
    [
        ("pseudonyms/001.key", _mode(0o644), r"others may use it \(mode 644\); chmod 600 it"),
        ("pseudonyms/000.key", _mode(0o640), r"others may use it \(mode 640\); chmod 600 it"),
        ("pseudonyms", _mode(0o750), r"others may use it \(mode 750\); chmod 700 it"),
        ("", _mode(0o755), r"others may use it \(mode 755\); chmod 700 it"),
        ("pseudonyms/000.key", lambda path: path.unlink(), "cannot be read: No such file"),
        ("pseudonyms/000.key", lambda path: path.write_text("rubbish"), "no private key in PEM"),
        (
            "pseudonyms/000.key",
            lambda path: path.write_bytes((path.parent / "001.key").read_bytes()),
            r"is not the key of 000\.cert",
        ),
        (
            "pseudonyms/000.cert",
            lambda path: path.write_bytes(path.read_bytes()[:-1]),
            "no 1609.2 certificate that can be used: ends after",
        ),
        (
            "roots",
            lambda path: [file.unlink() for file in path.iterdir()],
            "no certificate; no message could be verified",
        ),
        (
            "pseudonyms",
            lambda path: [file.unlink() for file in path.iterdir()],
            "no certificate; make some with `onboard keys car`",
        ),
        (
            "authorities",
            lambda path: [file.unlink() for file in path.iterdir()],
            r"pseudonyms/000\.cert: unknown_issuer",
        ),
    ],
)
def test_unusable_files_are_errors_with_the_remedy(
    tmp_path: Path, file: str, damage: Callable[..., Any], what: str
) -> None:
    car = tmp_path / "car"
    key_files.write_credentials(car, ALICE)
    damage(car / file)
    with pytest.raises(UserError, match=f"^{re.escape(str(car))}.*{what}"):
        key_files.read_credentials(car)


def test_existing_files_are_not_overwritten(tmp_path: Path) -> None:
    key_files.write_credentials(tmp_path / "car", ALICE)
    with pytest.raises(UserError, match="car: exists; remove it, or name another folder"):
        key_files.write_credentials(tmp_path / "car", BOB)


def test_keys_in_a_folder_that_is_not_there_say_how_to_make_it(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"trial/car: needs the folder .*: mkdir -p -m 700 .*trial"):
        key_files.write_credentials(tmp_path / "trial" / "car", BOB)


def test_a_psid_that_is_not_a_number_is_a_usage_error(tmp_path: Path) -> None:
    result = _run("root", tmp_path / "root", "--psid", "bsm")
    assert result.exit_code == 2
    assert "a PSID is a number" in result.output
    assert not (tmp_path / "root").exists()


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (("car", "new", "--issuing", "root"), "root: is a root; pseudonyms need an authority"),
        (("car", "new", "--issuing", "issuing", "--psid", "0x83"), "may not grant PSID 0x83"),
        (("issuing", "new", "--root", "issuing"), "is no root"),
    ],
)
def test_credentials_that_receivers_would_refuse_are_not_written(
    folder: Path, arguments: tuple[str, ...], what: str
) -> None:
    command, new, option, above, *rest = arguments
    result = _run(command, folder / new, option, folder / above, *rest)
    assert isinstance(result.exception, UserError)
    assert what in str(result.exception)
    assert not (folder / new).exists()


@pytest.mark.parametrize("psid", ["-1", "0x99999999999", "much"])
def test_a_psid_out_of_range_is_a_usage_error(tmp_path: Path, psid: str) -> None:
    result = _run("root", tmp_path / "root", f"--psid={psid}")
    assert result.exit_code == 2
    assert "a PSID is" in result.output


def test_a_clock_before_2004_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "time", lambda: 1000.0)
    result = _run("root", tmp_path / "root")
    assert isinstance(result.exception, UserError)
    assert "clock" in str(result.exception)
    assert not (tmp_path / "root").exists()


@pytest.mark.parametrize("name", ["x" * 256, ""])
def test_a_name_that_is_too_long_or_empty_is_a_usage_error(tmp_path: Path, name: str) -> None:
    result = _run("root", tmp_path / "root", "--name", name)
    assert result.exit_code == 2
    assert "255 octets" in result.output


def test_the_printed_validity_is_that_of_the_whole_chain(folder: Path) -> None:
    issuing = _run("issuing", folder / "short", "--root", folder / "root", "--days", 2).output
    car = _run("car", folder / "long", "--issuing", folder / "short", "--days", 9, "--count", 1)
    assert car.stdout.split(" to ")[1] == issuing.split(" to ")[1]
    assert "not valid for 9 days: an authority of" in car.stderr
    assert _run("car", folder / "c", "--issuing", folder / "short", "--days", 1).stderr == ""


def test_credentials_that_lack_a_service_of_the_car_are_an_error(folder: Path) -> None:
    with pytest.raises(UserError, match=r"000.cert: does not allow PSID 0x4020"):
        key_files.read_credentials(folder / "b", (BSM, LCCA))
    key_files.read_credentials(folder / "a", (BSM, LCCA))
