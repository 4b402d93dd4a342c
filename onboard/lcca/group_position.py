"""A vehicle's leader and number in its group, and the rule that keeps numbers from counting up.

If A followed B and B followed A, each would number itself behind the other, without bound. This is
the count-to-infinity problem of distance vector routing, and so is its solution: the feasibility
condition of DUAL and Babel (RFC 8966, section 2.4) with the sequence numbers of DSDV. The leader
counts its replies, and each reply carries the newest count (`leader_sequence`) that its sender has
received. Under its leader, a vehicle takes another position only with a newer sequence number, or
with a group number that is not larger. A message about itself that returns through the vehicles
behind it never has a newer sequence number, and always has a larger group number.

Vehicles that read each other's plates may still close a circle, while their leaders change. It has
no leader that could send new sequence numbers, and so it ends after `leader_silence_s`.
"""

from collections.abc import Mapping

from onboard.messages.lcca import CarId

_MODULUS = 1 << 16
LARGEST_ADVANCE = _MODULUS // 2 - 1024
"""Of an own count: still newer than what a vehicle that missed 1023 counts has received."""


def is_newer(sequence: int, than: int) -> bool:
    """Compare two sequence numbers that wrap at 16 bits (serial number arithmetic, RFC 1982)."""
    return 0 < (sequence - than) % _MODULUS < _MODULUS // 2


class GroupPosition:
    """Own ID, leader, group number and leader sequence number."""

    def __init__(self, own_id: CarId, leader_sequence: int) -> None:
        """Start in no group.

        Args:
            own_id: the own communication ID.
            leader_sequence: where the own count starts.
        """
        self.own_id = own_id
        self.leader_id = own_id
        self.number = 1
        self._own_sequence = self._received_sequence = leader_sequence

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
        """Whether `sequence` is newer than the own leader's, or another one's."""
        return leader_id != self.leader_id or is_newer(sequence, self._received_sequence)

    def forms_loop(self, leader_id: CarId, number: int, sequence: int) -> bool:
        """Whether this vehicle might follow itself in that position (feasibility condition).

        Args:
            leader_id: the leader of the position.
            number: its group number.
            sequence: the leader sequence number that came with it.
        """
        if leader_id == self.own_id:
            return True
        if self.is_newer(leader_id, sequence):
            return False
        return sequence != self._received_sequence or number > self.number

    def take(self, leader_id: CarId, number: int, sequence: int) -> None:
        """Take a position that forms no loop (`forms_loop`).

        Args:
            leader_id: the new leader.
            number: the new group number.
            sequence: the leader sequence number that came with it.
        """
        self.leader_id, self.number, self._received_sequence = leader_id, number, sequence
