"""A vehicle's leader and number in its group, and the rule that keeps groups free of loops.

If A followed B and B followed A, each would number itself behind the other, without bound. This is
the count-to-infinity problem of distance vector routing, and so is its solution: the feasibility
condition of DUAL and Babel (RFC 8966, section 2.4) with the sequence numbers of DSDV. The leader
counts its replies, and each reply carries the newest count (`leader_sequence`) that its sender has
received. For each leader, a vehicle stores the newest sequence number and the smallest group number
that it has had under it. It takes a position under that leader only with a newer sequence number,
or with a group number that is not larger. A message about itself that returns through the vehicles
behind it never has a newer sequence number, and always has a larger group number.

One loop remains: two vehicles that read each other's plate and join at the same moment both accept
a reply sent before the other moved. It does not count up, it has no leader that could send new
sequence numbers, and so it ends after `leader_silence_s`.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from onboard.messages.lcca import CarId

_MODULUS = 1 << 16
LARGEST_ADVANCE = _MODULUS // 2 - 1024
"""Of an own count: still newer than what a vehicle that missed 1023 counts has received."""


def is_newer(sequence: int, than: int) -> bool:
    """Compare two sequence numbers that wrap at 16 bits (serial number arithmetic, RFC 1982)."""
    return 0 < (sequence - than) % _MODULUS < _MODULUS // 2


@dataclass(slots=True)
class _FeasiblePosition:
    """The smallest group number under one leader, for its newest sequence number."""

    leader_sequence: int
    number: int
    forget_at: float


class GroupPosition:
    """Own ID, leader, group number and leader sequence number."""

    def __init__(self, own_id: CarId, memory_s: float, leader_sequence: int) -> None:
        """Start in no group.

        Args:
            own_id: the own communication ID.
            memory_s: how long the position under a former leader is stored.
            leader_sequence: where the own count starts.
        """
        self.own_id = own_id
        self.leader_id = own_id
        self.number = 1
        self._memory_s = memory_s
        self._own_sequence = self._received_sequence = leader_sequence
        self._feasible: dict[CarId, _FeasiblePosition] = {}

    @property
    def header(self) -> tuple[CarId, CarId, int]:
        """The first fields of every message: own ID, leader, number."""
        return self.own_id, self.leader_id, self.number

    @property
    def in_group(self) -> tuple[CarId, int]:
        """Leader and number."""
        return self.leader_id, self.number

    @property
    def leader_sequence(self) -> int:
        """The newest sequence number known of the own leader."""
        return self._own_sequence if self.number == 1 else self._received_sequence

    def next_leader_sequence(self) -> int:
        """Return the sequence number for a reply: a leader counts up, a member passes it on."""
        if self.number == 1:
            self._own_sequence = (self._own_sequence + 1) % _MODULUS
        return self.leader_sequence

    def rename(self, names: Mapping[CarId, CarId]) -> None:
        """Take the new IDs, by the old ones, of this vehicle and of leaders."""
        self.own_id = names.get(self.own_id, self.own_id)
        self.leader_id = names.get(self.leader_id, self.leader_id)
        self._feasible = {names.get(key, key): each for key, each in self._feasible.items()}

    def advance(self, counts: int) -> None:
        """Skip counts of the own sequence, at most `LARGEST_ADVANCE`.

        A random number of them, with a new ID, leaves an eavesdropper one bit of the old count. A
        count that begins anew would be refused as old by followers that rename their leader.
        """
        self._own_sequence = (self._own_sequence + counts) % _MODULUS

    def become_first(self) -> None:
        """Take number 1: no vehicle is followed any more."""
        self._own_sequence = (self._own_sequence + 1) % _MODULUS
        self.leader_id = self.own_id
        self.number = 1

    def is_newer(self, leader_id: CarId, sequence: int) -> bool:
        """Whether `sequence` is the first or a newer one of that leader."""
        feasible = self._feasible.get(leader_id)
        return feasible is None or is_newer(sequence, feasible.leader_sequence)

    def forms_loop(self, leader_id: CarId, number: int, sequence: int, now: float) -> bool:
        """Whether this vehicle might follow itself in that position (feasibility condition).

        Args:
            leader_id: the leader of the position.
            number: its group number.
            sequence: the leader sequence number that came with it.
            now: seconds on the cores' clock.
        """
        if leader_id == self.own_id:
            return True
        feasible = self._feasible.get(leader_id)
        if (
            feasible is None
            or feasible.forget_at <= now
            or is_newer(sequence, feasible.leader_sequence)
        ):
            return False
        return sequence != feasible.leader_sequence or number > feasible.number

    def take(self, leader_id: CarId, number: int, sequence: int, now: float) -> None:
        """Take a position that forms no loop (`forms_loop`).

        Args:
            leader_id: the new leader.
            number: the new group number.
            sequence: the leader sequence number that came with it.
            now: seconds on the cores' clock.
        """
        self._feasible[leader_id] = _FeasiblePosition(sequence, number, now + self._memory_s)
        self.leader_id, self.number, self._received_sequence = leader_id, number, sequence
        for old in [key for key, each in self._feasible.items() if each.forget_at <= now]:
            del self._feasible[old]
