"""Where a car stands in its group, and why no misread plate can make it count without end.

If A followed B and B followed A, each would number itself behind the other, higher and higher.
Distance vector routing knows the problem and its cure: the *feasibility condition* of DUAL and
Babel (RFC 8966, section 2.4) with the sequence numbers of DSDV. The leader counts its replies, and
each reply hands down the newest count (*beat*) that its sender has seen. For each leader, a car
remembers the newest beat and the smallest number that it has had under it. It takes a place under
that leader only from a newer beat, or a number that is not larger than that. News of itself that
comes round through those behind it is never newer, and its number always larger.

One circle is left: two cars that read each other's plate and ask at the same moment both believe an
answer given before the other moved. It counts no higher, has no leader whose beats could be new,
and so lapses after `leader_silence_s`.
"""

from dataclasses import dataclass

from onboard.messages.lcca import CarId

_MODULUS = 1 << 16


def is_newer(beat: int, than: int) -> bool:
    """Compare two counts that wrap at 16 bits (serial number arithmetic, RFC 1982)."""
    return 0 < (beat - than) % _MODULUS < _MODULUS // 2


@dataclass(slots=True)
class _LowestPosition:
    """The best place that this car has had under one leader."""

    beat: int
    number: int
    forget_at: float


class GroupPosition:
    """Who this car is, and its leader, number and beat."""

    def __init__(self, own_id: CarId, memory_s: float, beat: int) -> None:
        """Stand alone. `beat` is where the own count starts."""
        self.own_id = own_id
        self.own_ids: tuple[CarId, ...] = (own_id,)
        """The present ID and, while cars change theirs, the previous one."""
        self.leader_id = own_id
        self.number = 1
        self._memory_s = memory_s
        self._own_beat = self._handed_beat = beat
        self._best: dict[CarId, _LowestPosition] = {}

    @property
    def header(self) -> tuple[CarId, CarId, int]:
        """How every message begins: own ID, leader, number."""
        return self.own_id, self.leader_id, self.number

    @property
    def in_group(self) -> tuple[CarId, int]:
        """Leader and number."""
        return self.leader_id, self.number

    @property
    def beat(self) -> int:
        """The newest beat known of the own leader."""
        return self._own_beat if self.number == 1 else self._handed_beat

    def next_beat(self) -> int:
        """Return the beat for a reply: a leader counts, a member hands on."""
        if self.number == 1:
            self._own_beat = (self._own_beat + 1) % _MODULUS
        return self.beat

    def rename(self, own_id: CarId) -> None:
        """Be known by another ID, and for a while still by the present one."""
        self.own_ids = (own_id, self.own_id)
        self.own_id = own_id
        if self.number == 1:
            self.leader_id = own_id

    def drop_previous_id(self) -> None:
        """Be known by the present ID only."""
        self.own_ids = (self.own_id,)

    def lead(self) -> None:
        """Stand at the head of what follows."""
        self._own_beat = (self._own_beat + 1) % _MODULUS
        self.leader_id = self.own_id
        self.number = 1

    def is_news(self, leader_id: CarId, beat: int) -> bool:
        """Whether `beat` is the first or a newer one of that leader."""
        best = self._best.get(leader_id)
        return best is None or is_newer(beat, best.beat)

    def closes_circle(self, leader_id: CarId, number: int, beat: int, now: float) -> bool:
        """Whether taking that place might mean following oneself."""
        if leader_id in self.own_ids:
            return True
        best = self._best.get(leader_id)
        if best is None or best.forget_at <= now or is_newer(beat, best.beat):
            return False
        return beat != best.beat or number > best.number

    def take(self, leader_id: CarId, number: int, beat: int, now: float) -> None:
        """Stand there, after `closes_circle` said no: it is the best place of all so far."""
        self._best[leader_id] = _LowestPosition(beat, number, now + self._memory_s)
        self.leader_id, self.number, self._handed_beat = leader_id, number, beat
        for old in [key for key, best in self._best.items() if best.forget_at <= now]:
            del self._best[old]
