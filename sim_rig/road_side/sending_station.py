"""A station that sends beside the cars of a scenario, on their radio channel."""

from abc import abstractmethod
from collections.abc import Callable, Iterator

from typing_extensions import override

from onboard.security.security_services import SecurityServices
from onboard.vehicle.framing import RadioFraming, WaveFraming
from onboard.vehicle.its_g5_framing import ItsG5Framing
from onboard.wave_udp import psid
from onboard.wave_udp.settings import RadioProfile
from sim_rig.radio.air import Air, Delivery


class SendingStation(Air):
    """Adds the messages of one station, which receives nothing, to another `Air`."""

    interval_s = 0.1
    """Between two transmissions."""
    user_priority: int
    station_type: int
    """In the address of its packets with ITS-G5."""

    def __init__(
        self,
        air: Air,
        name: str,
        profile: RadioProfile,
        at_s: Callable[[float], float],
        security: SecurityServices,
        *,
        now: float,
    ) -> None:
        """Start the station.

        Args:
            air: the channel, of which it is a station.
            name: its name on the channel.
            profile: its messages and headers.
            at_s: time since the start of the scenario at a `now`, s.
            security: signs its messages.
            now: monotonic time, s.
        """
        self._air = air
        self._name = name
        self._at_s = at_s
        self._security = security
        self._is_its = profile is RadioProfile.ITS_G5
        self._framing: RadioFraming = (
            ItsG5Framing(psid.LCCA, lambda: None, self.station_type)
            if self._is_its
            else WaveFraming()
        )
        self._due_at = now

    @abstractmethod
    def messages_to_send(self, now: float) -> Iterator[tuple[int, bytes]]:
        """Yield what is sent each `interval_s`: services and messages."""

    @override
    def receive_wsm(self, sender: str, wsm: bytes, user_priority: int, now: float) -> None:
        self._air.receive_wsm(sender, wsm, user_priority, now)

    @override
    def wsms_to_deliver(self, now: float) -> list[Delivery]:
        """Return the copies that have arrived at others by `now`, after sending what is due."""
        if self._due_at <= now:
            late_s = now - self._due_at
            # What a late rig has missed is not sent: it would be stale.
            self._due_at += self.interval_s * (1 + late_s // self.interval_s)
            for service, message in self.messages_to_send(now):
                self._send(service, message, now)
        return [each for each in self._air.wsms_to_deliver(now) if each.receiver != self._name]

    @override
    def get_timer(self) -> float:
        """Return when the next copy arrives or the next message is due."""
        return min(self._due_at, self._air.get_timer())

    def _send(self, service: int, message: bytes, now: float) -> None:
        utc_s = self._security.utc_s(now)
        signed_part = self._framing.signed_part(message, service, self.user_priority, now, utc_s)
        frame = self._framing.frame(service, self._security.secure(signed_part, service, now))
        self._air.receive_wsm(self._name, frame, self.user_priority, now)
