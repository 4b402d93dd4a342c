"""Signatures of files by the root of a trial."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from onboard.errors import UserError
from onboard.security.file_signature import sign_file, signer_of_file
from onboard.security.key_files import write_authority
from onboard.tools.test_ca.authority import make_issuing, make_root
from onboard.tools.test_ca.cli import keys
from onboard.wave_udp import psid

VALID: dict[str, Any] = {"valid_from_utc_s": 1_700_000_000.0, "valid_for_s": 1e8}
ROOT, OTHER = (make_root(name, psid.OF_VEHICLES, **VALID) for name in ("one trial", "another"))
CERTIFICATE = ROOT.credential.certificate


@given(st.binary(max_size=1000))
def test_the_root_that_signed_a_file_is_found(content: bytes) -> None:
    roots = [OTHER.credential.certificate, CERTIFICATE]
    assert signer_of_file(content, sign_file(content, ROOT.credential), roots) == CERTIFICATE


def test_a_changed_file_and_the_root_of_another_trial_are_refused() -> None:
    signature = sign_file(b"content", ROOT.credential)
    assert signer_of_file(b"contents", signature, [CERTIFICATE]) is None
    assert signer_of_file(b"content", signature, [OTHER.credential.certificate]) is None


@given(st.text(max_size=140) | st.binary(max_size=66).map(bytes.hex))
def test_what_is_no_signature_is_refused(signature: str) -> None:
    assert signer_of_file(b"content", signature, [CERTIFICATE]) is None


def test_a_file_is_signed_and_verified_by_command(tmp_path: Path) -> None:
    write_authority(tmp_path / "root", ROOT)
    write_authority(tmp_path / "other", OTHER)
    file = tmp_path / "SHA256SUMS"
    file.write_text("0123  wheel\n")

    def run(*arguments: object) -> object:
        return CliRunner().invoke(keys, [str(each) for each in arguments], catch_exceptions=False)

    assert "signed by one trial" in run("sign", file, "--root", tmp_path / "root").output  # type: ignore[attr-defined]
    by = ("--signature", f"{file}.sig", "--trusted")
    assert "signed by one trial" in run("verify", file, *by, tmp_path / "root").output  # type: ignore[attr-defined]
    with pytest.raises(UserError, match=r"not signed by a root of .*other \(another\)"):
        run("verify", file, *by, tmp_path / "other")


def test_an_authority_below_the_root_signs_no_file(tmp_path: Path) -> None:
    write_authority(tmp_path / "issuing", make_issuing(ROOT, "issuing", **VALID))
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="is no root"):
        CliRunner().invoke(
            keys,
            ["sign", str(tmp_path / "file"), "--root", str(tmp_path / "issuing")],
            catch_exceptions=False,
        )
