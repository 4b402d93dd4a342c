"""What tests of this room share."""

import pytest


@pytest.fixture(scope="module")
def oracle():
    from pycrate_asn1dir.ITS_IEEE1609_2 import Ieee1609Dot2

    return Ieee1609Dot2
