"""Credentials of cars that trust each other, the same in every run."""

from functools import cache
from typing import Any

import numpy as np

from onboard.security import p256
from onboard.security.credentials import Credentials
from onboard.security.plate_digest import PlateDigest
from onboard.security.security_services import SecurityServices
from onboard.security.settings import PlateDigestSettings
from onboard.tools.test_ca.authority import KnownPlate, make_issuing, make_pseudonyms, make_root

UTC_S = 1_790_000_000.0
"""UTC at monotonic time 0 in all of these tests."""
BSM, LCCA = 0x20, 0x4020
VALID: dict[str, Any] = {"valid_from_utc_s": UTC_S - 3600, "valid_for_s": 86_400.0}

new_key = p256.key_from(np.random.default_rng(1609))

ROOT = make_root("root", {BSM, LCCA}, new_key=new_key, **VALID)
ISSUING = make_issuing(ROOT, "issuing", new_key=new_key, **VALID)
ALICE, BOB, CAROL, DAVE = (
    make_pseudonyms(ISSUING, 3, {BSM, LCCA}, new_key=new_key, **VALID) for _ in range(4)
)
"""Of an authority that knows no plates."""


def credentials_of(plate: str, epoch_s: float = 300.0) -> Credentials:
    """Return the certificates of a vehicle whose plate the authority knows."""
    return _issued(plate, epoch_s)


@cache
def _issued(plate: str, epoch_s: float) -> Credentials:
    digest = PlateDigest(PlateDigestSettings(scrypt_log2_n=1, epoch_s=epoch_s))
    return make_pseudonyms(
        ISSUING, 3, {BSM, LCCA}, new_key=new_key, plate=KnownPlate(plate, digest), **VALID
    )


def security(credentials: Credentials | None = None) -> SecurityServices:
    return SecurityServices(utc_offset_s=UTC_S, credentials=credentials)


def reread(structure: Any, data: bytes) -> Any:
    """Return what the oracle decodes of `data`, after it has encoded the same bytes again."""
    structure.from_coer(data)
    value = structure.get_val()
    structure.set_val(value)
    assert structure.to_coer() == data
    return value
