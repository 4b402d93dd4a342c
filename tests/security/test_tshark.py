"""Wireshark decodes our 1609.2 data with nothing malformed."""

import json
import shutil
import subprocess
from typing import Any

import pytest

from onboard.messages import bsm
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.security import its_time
from onboard.security.certificate_codec import decode_certificate
from onboard.security.ieee1609dot2 import Location
from onboard.wave_udp import wsmp
from onboard.wave_udp.capture import PcapWriter
from onboard.wave_udp.wsmp import WaveShortMessage
from tests.security.trial import ALICE, BSM, ISSUING, UTC_S, security
from tests.typed import a

FRAME = bsm.encode(BasicSafetyMessage(CoreData(5, b"abcd"), footer=bytes(200)))


@pytest.fixture(scope="module")
def packets(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """With certificate; by digest; with expiry and location; unsecured."""
    if shutil.which("tshark") is None:
        pytest.skip("tshark is not installed")
    alice = security(ALICE)
    secured = [alice.secure(FRAME, BSM, now) for now in (0.0, 0.1)]
    secured.append(
        alice.secure(FRAME, BSM, 0.2, expires_in_s=1.0, location=Location(25.033, 121.5654, 12.0))
    )
    secured.append(security().secure(FRAME, BSM, 0.3))
    path = tmp_path_factory.mktemp("tshark") / "signed.pcap"
    with path.open("wb") as file:
        writer = PcapWriter(file)
        for data in secured:
            writer.write(wsmp.encode(WaveShortMessage(BSM, data)), UTC_S, b"\x02CAR01")
    command = ["tshark", "-n", "-r", str(path), "-T", "json", "--no-duplicate-keys"]
    output = subprocess.run(command, capture_output=True, check=True, timeout=60).stdout
    return [packet["_source"]["layers"] for packet in json.loads(output)]


def values(tree: Any, name: str) -> list[str]:
    """Return every value of field `name` in a packet."""
    if isinstance(tree, list):
        return [value for item in tree for value in values(item, name)]
    if not isinstance(tree, dict):
        return []
    own = [tree[name]] if name in tree else []
    return own + [value for inner in tree.values() for value in values(inner, name)]


def octets(text: str) -> bytes:
    return bytes.fromhex(text.replace(":", ""))


def test_nothing_is_malformed_and_no_byte_is_left_over(packets: Any) -> None:
    assert len(packets) == 4
    for packet in packets:
        text = json.dumps(packet)
        assert "ieee1609dot2" in text
        assert "_ws.malformed" not in text
        assert "_ws.expert" not in text
        assert "data.data" not in text


def test_the_payload_is_the_message_frame(packets: Any) -> None:
    for packet in packets:
        assert octets(values(packet, "ieee1609dot2.unsecuredData")[0]) == FRAME


def test_the_header_has_the_encoded_values(packets: Any) -> None:
    for packet, tenths in zip(packets[:3], range(3), strict=True):
        assert values(packet, "ieee1609dot2.psid")[0] == str(BSM)
        expected = its_time.to_time64(UTC_S + tenths / 10)
        assert values(packet, "ieee1609dot2.generationTime") == [str(expected)]
    with_location = packets[2]
    assert values(with_location, "ieee1609dot2.expiryTime") == [
        str(its_time.to_time64(UTC_S + 0.2) + 1_000_000)
    ]
    place = ("latitude", "longitude", "elevation")
    assert [values(with_location, f"ieee1609dot2.{name}") for name in place] == [
        ["250330000"],
        ["1215654000"],
        ["4216"],
    ]


def test_the_signer_is_the_certificate_or_its_digest(packets: Any) -> None:
    own = ALICE.pseudonyms[0].certificate
    first, second = packets[:2]
    issuer = octets(values(first, "ieee1609dot2.sha256AndDigest")[0])
    assert issuer == ISSUING.credential.certificate.hashed_id8
    key = a(bytes, own.subject.public_key)
    form = "compressed_y_0" if key[0] == 2 else "compressed_y_1"
    assert octets(values(first, f"ieee1609dot2.{form}")[0]) == key[1:]
    assert [int(psid) for psid in values(first, "ieee1609dot2.psid")] == [
        BSM,
        *(permission.psid for permission in own.subject.permissions),
    ]
    assert values(second, "ieee1609dot2.Certificate_element") == []
    assert octets(values(second, "ieee1609dot2.digest")[0]) == own.hashed_id8


def test_a_certificate_on_disk_equals_the_transmitted_one() -> None:
    own = ALICE.pseudonyms[0].certificate
    data = security(ALICE).secure(FRAME, BSM, now=0.0)
    assert own.encoded in data
    assert decode_certificate(own.encoded) == own
