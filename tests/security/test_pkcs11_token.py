"""Private keys in a PKCS #11 token: SoftHSM, a software token with the interface of real ones."""

import copy
import os
import shutil
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from typer.testing import CliRunner

from onboard.errors import UserError
from onboard.security import key_files, p256, pkcs11_token
from onboard.security.pkcs11_token import Pkcs11Token, TokenError
from onboard.security.security_services import SecurityServices
from onboard.security.settings import TokenSettings
from onboard.settings import load_settings
from onboard.tools.cli import app
from onboard.tools.doctor.computer import examine_keys
from onboard.tools.doctor.finding import FindingLevel
from onboard.vehicle.config import CarConfig
from onboard.wave_udp.psid import BSM

MODULE = Path("/usr/lib/softhsm/libsofthsm2.so")
PIN = "1234"

needs_token = pytest.mark.skipif(
    not MODULE.exists() or shutil.which("softhsm2-util") is None,
    reason="SoftHSM (softhsm2) is not installed",
)


def write_pin(path: Path, pin: str) -> None:
    path.touch(0o600)
    path.write_text(pin)


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> TokenSettings:
    """A new token; the module reads its configuration once in a process."""
    folder = tmp_path_factory.mktemp("token")
    (folder / "tokens").mkdir()
    (folder / "softhsm2.conf").write_text(f"directories.tokendir = {folder}/tokens\n")
    write_pin(folder / "pin", f"{PIN}\n")
    os.environ["SOFTHSM2_CONF"] = str(folder / "softhsm2.conf")
    subprocess.run(
        [
            "softhsm2-util",
            "--init-token",
            "--free",
            "--label",
            "car",
            "--pin",
            PIN,
            "--so-pin",
            PIN,
        ],
        check=True,
        capture_output=True,
    )
    return TokenSettings(module=MODULE, label="car", pin_file=folder / "pin")


@pytest.fixture
def token(settings: TokenSettings) -> Pkcs11Token:
    return Pkcs11Token(settings)


@needs_token
def test_a_key_of_the_token_signs_what_others_verify(token: Pkcs11Token) -> None:
    key, digest = token.new_key(), bytes(range(32))
    assert p256.is_signed(key.public_key(), digest, p256.sign(key, digest))
    assert not p256.is_signed(key.public_key(), digest[::-1], p256.sign(key, digest))


@needs_token
def test_a_key_is_found_by_its_public_key_in_another_session(
    token: Pkcs11Token, settings: TokenSettings
) -> None:
    made = [token.new_key() for _ in range(3)]
    digest = bytes(32)
    for key in made:
        found = Pkcs11Token(settings).key_of(key.public_key())
        assert p256.is_signed(key.public_key(), digest, p256.sign(found, digest))


@needs_token
def test_a_key_that_the_token_does_not_have_is_named(token: Pkcs11Token) -> None:
    other = p256.new_key().public_key()
    with pytest.raises(
        TokenError, match=f"token car: has no key for {p256.compressed(other).hex()}"
    ):
        token.key_of(other)


@needs_token
def test_a_token_that_fails_later_is_named(
    token: Pkcs11Token, monkeypatch: pytest.MonkeyPatch
) -> None:
    import pkcs11

    key = token.new_key()
    wanted = {pkcs11.Attribute.CLASS: pkcs11.ObjectClass.PRIVATE_KEY}
    for private in list(token._session.get_objects(wanted)):
        private.destroy()
    with pytest.raises(TokenError, match=r"token car: No key matching"):
        token.key_of(key.public_key())
    with pytest.raises(TokenError, match=r"token car: ObjectHandleInvalid"):
        p256.sign(key, bytes(32))

    def full(*_: object, **__: object) -> None:
        raise pkcs11.DeviceMemory

    session = SimpleNamespace(create_domain_parameters=full)
    monkeypatch.setattr(token, "_session", session)
    with pytest.raises(TokenError, match=r"token car: DeviceMemory"):
        token.new_key()


@needs_token
def test_the_private_key_stays_in_the_token(token: Pkcs11Token) -> None:
    key = token.new_key()
    assert key.key_size == 256
    assert copy.copy(key) is key
    with pytest.raises(TokenError, match="stays in its token"):
        key.private_numbers()
    with pytest.raises(TokenError, match="stays in its token"):
        key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    with pytest.raises(TokenError, match="stays in its token"):
        key.exchange(ec.ECDH(), p256.new_key().public_key())


@needs_token
def test_a_car_with_its_keys_in_a_token_signs_for_one_with_files(
    settings: TokenSettings, token: Pkcs11Token, tmp_path: Path
) -> None:
    config = tmp_path / "car.yaml"
    config.write_text(
        "car: {plate: ABC1234}\n"
        "security:\n"
        f"  keys_folder: {tmp_path / 'car'}\n"
        f"  token: {{module: {MODULE}, label: car, pin_file: {settings.pin_file}}}\n"
        "  plate_digest: {scrypt_log2_n: 1}\n"  # of all its certificates' epochs
    )
    for command in (
        ["root", tmp_path / "root"],
        ["issuing", tmp_path / "issuing", "--root", tmp_path / "root"],
        [
            "car",
            tmp_path / "car",
            "--issuing",
            tmp_path / "issuing",
            "--config",
            config,
            "--count",
            2,
        ],
        ["car", tmp_path / "other", "--issuing", tmp_path / "issuing", "--count", 1],
    ):
        made = CliRunner().invoke(app, ["keys", *map(str, command)])
        assert made.exit_code == 0, made.output
    assert not list((tmp_path / "car").rglob("*.key"))
    security = load_settings(config, CarConfig).security
    own = key_files.read_own_credentials(security, "ABC1234", (BSM,))
    assert own is not None
    assert len(own.pseudonyms) == 2
    message = SecurityServices(time.time(), own).secure(b"brakes", BSM, 0.0)
    other = SecurityServices(time.time(), key_files.read_credentials(tmp_path / "other"))
    assert other.open(message, BSM, 0.1).payload == b"brakes"
    found = examine_keys(security, "ABC1234", time.time())
    assert {each.level for each in found if "pseudonyms" in each.detail} == {FindingLevel.GOOD}
    with pytest.raises(key_files.KeyFilesError, match=r"000\.key: cannot be read"):
        key_files.read_credentials(tmp_path / "car")
    keys = len(list(token._session.get_objects()))
    again = ["keys", "car", str(tmp_path / "car"), "--issuing", str(tmp_path / "issuing")]
    refused = CliRunner().invoke(app, [*again, "--config", str(config)])
    assert (
        str(refused.exception) == f"{tmp_path / 'car'}: exists; remove it, or name another folder"
    )
    assert len(list(token._session.get_objects())) == keys


@needs_token
def test_a_wrong_pin_and_a_missing_token_are_named(settings: TokenSettings, tmp_path: Path) -> None:
    with pytest.raises(TokenError, match=r"token bus of .*libsofthsm2\.so: "):
        Pkcs11Token(settings.model_copy(update={"label": "bus"}))
    with pytest.raises(TokenError, match=r"pin: cannot be read: No such file"):
        Pkcs11Token(settings.model_copy(update={"pin_file": tmp_path / "pin"}))
    (tmp_path / "pin").write_bytes(b"\xff")
    with pytest.raises(TokenError, match=r"pin: is no text in UTF-8"):
        Pkcs11Token(settings.model_copy(update={"pin_file": tmp_path / "pin"}))


@pytest.mark.parametrize("mode", [0o644, 0o640, 0o604, 0o620])
def test_a_pin_that_others_may_use_is_refused_with_what_to_do(tmp_path: Path, mode: int) -> None:
    write_pin(tmp_path / "pin", PIN)
    (tmp_path / "pin").chmod(mode)
    given = TokenSettings(module=tmp_path / "no.so", label="car", pin_file=tmp_path / "pin")
    with pytest.raises(
        TokenError, match=rf"pin: others may use it \(mode {mode:o}\); chmod 600 it"
    ):
        Pkcs11Token(given)


def test_a_token_without_certificates_is_a_mistake(tmp_path: Path) -> None:
    config = tmp_path / "car.yaml"
    config.write_text(
        "car: {plate: ABC1234}\nsecurity: {token: {module: m.so, label: car, pin_file: pin}}\n"
    )
    with pytest.raises(UserError, match="security: `token` needs `keys_folder`"):
        load_settings(config, CarConfig)


def test_a_token_is_not_locked_by_a_service_that_starts_again_and_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_pin(tmp_path / "pin", "a wrong one")
    module = pytest.importorskip("pkcs11")
    tries_left = 3

    class Token:
        @property
        def flags(self) -> object:
            return module.TokenFlag.USER_PIN_FINAL_TRY if tries_left == 1 else module.TokenFlag(0)

        def open(self, **_: object) -> None:
            nonlocal tries_left
            tries_left -= 1
            raise module.PinIncorrect

    library = SimpleNamespace(get_token=lambda token_label: Token())
    monkeypatch.setattr(module, "lib", lambda _: library)
    given = TokenSettings(module=tmp_path / "so", label="card", pin_file=tmp_path / "pin")
    for _ in range(2):
        with pytest.raises(TokenError, match=r"token card of .*so: PinIncorrect"):
            Pkcs11Token(given)
    for _ in range(5):
        with pytest.raises(TokenError, match=r"a wrong PIN would lock it.*pkcs11-tool --login"):
            Pkcs11Token(given)
    assert tries_left == 1


def test_a_missing_library_is_named(tmp_path: Path) -> None:
    write_pin(tmp_path / "pin", PIN)
    given = TokenSettings(module=tmp_path / "no.so", label="car", pin_file=tmp_path / "pin")
    with pytest.raises(TokenError, match=r"token car of .*no\.so: "):
        Pkcs11Token(given)


def test_a_missing_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pkcs11_token, "pkcs11", None)
    given = TokenSettings(module=tmp_path / "no.so", label="car", pin_file=tmp_path / "pin")
    with pytest.raises(TokenError, match=r"pip install 'onboard\[pkcs11\]'"):
        Pkcs11Token(given)
