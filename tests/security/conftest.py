"""What tests of this room share."""

from typing import Any

import pytest


@pytest.fixture(scope="module")
def oracle() -> Any:
    from pycrate_asn1dir.ITS_IEEE1609_2 import Ieee1609Dot2

    return Ieee1609Dot2
