"""The core between the messages and the radio: secures what goes out, opens what came in."""

from dataclasses import dataclass

from onboard.security import oer

_UNSECURED_HEAD = b"\x03\x80"
"""Protocol version 3, content choice 0: unsecuredData (IEEE 1609.2-2022, 6.3.4)."""


class NotTrusted(Exception):  # noqa: N818 (the sender's fault, not an error of ours)
    """A message that must not be believed."""

    def __init__(self, reason: str, detail: str = "") -> None:
        super().__init__(f"{reason}: {detail}" if detail else reason)
        self.reason = reason
        """A short stable word, fit for a counter's label."""
        self.detail = detail


@dataclass(frozen=True, slots=True)
class Opened:
    """A message out of its envelope."""

    payload: bytes
    signer_id: bytes | None
    """HashedId8 of the certificate that signed it; `None`: nobody vouches for it."""
    generation_utc_s: float | None


class Security:
    """Wraps and unwraps 1609.2 data. `now` is the car's clock; UTC is `now + utc_offset_s`."""

    def __init__(self, utc_offset_s: float) -> None:
        self.utc_offset_s = utc_offset_s

    def secure(self, payload: bytes, psid: int, now: float) -> bytes:
        """Return `payload` as Ieee1609Dot2Data, to be sent under `psid`."""
        return _UNSECURED_HEAD + oer.octets(payload)

    def open(self, data: bytes, psid: int, now: float) -> Opened:
        """Return what `data`, received under `psid`, carries.

        Raises:
            NotTrusted: it must not be believed; `reason` says why.
        """
        if data[:2] != _UNSECURED_HEAD:
            raise NotTrusted("malformed", "not unsecured data")
        reader = oer.Reader(data, position=len(_UNSECURED_HEAD))
        try:
            payload = reader.octets()
            reader.finish()
        except oer.Malformed as malformed:
            raise NotTrusted("malformed", str(malformed)) from malformed
        return Opened(payload, signer_id=None, generation_utc_s=None)
