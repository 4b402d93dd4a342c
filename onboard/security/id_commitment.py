"""The vehicle IDs that a certificate commits to, and the proof that one of them is among them.

An authority that knows the plate puts the root of a Merkle tree over a certificate's epochs, each
with its communication ID, into it, as the service-specific permissions (SSP) of LCCA. Whoever sends
under an ID proves it by the siblings on the way from epoch and ID up to the root, of its own
certificate. So no certificate speaks for another vehicle, nor under two IDs at a time, and the IDs
of other epochs stay hidden.

Leaves and nodes are hashed apart, as in RFC 9162, 2.1.1, so that no node passes for an ID. The two
children of a node are hashed in the order of their values: a proof needs no directions.
"""

import hashlib
from collections.abc import Sequence
from itertools import zip_longest

NODE_BYTES = 12
"""Bytes kept of each SHA-256: another ID with a proof takes 2^96 trials, in five minutes."""
MAX_PROOF = 16
"""Siblings in a proof: of certificates with 65,536 epochs."""

_SSP_VERSION = b"\x02"
_LEAF, _NODE = b"\x00", b"\x01"

Proof = tuple[bytes, ...]
"""Siblings from the leaf upwards, each of `NODE_BYTES`."""


def leaf(epoch: int, car_id: bytes) -> bytes:
    """Return the leaf of the communication ID of an epoch, by its number."""
    return _hashed(_LEAF + epoch.to_bytes(8, signed=True) + car_id)


def leaves_in(data: bytes) -> tuple[bytes, ...]:
    """Return the leaves that stand one after the other in a file."""
    return tuple(data[at : at + NODE_BYTES] for at in range(0, len(data), NODE_BYTES))


def root_of(leaves: Sequence[bytes]) -> bytes:
    """Return the root over one or more leaves."""
    return _levels(leaves)[-1][0]


def proof_of(own: bytes, leaves: Sequence[bytes]) -> Proof | None:
    """Return the proof that a leaf is among `leaves`; `None` if it is not."""
    if own not in leaves:
        return None
    proof, at = [], leaves.index(own)
    for level in _levels(leaves)[:-1]:
        sibling = at ^ 1
        if sibling < len(level):
            proof.append(level[sibling])
        at //= 2
    return tuple(proof)


def is_proved(own: bytes, proof: Proof, root: bytes) -> bool:
    """Whether `proof` shows that a certificate with this root commits to the leaf `own`."""
    node = own
    for sibling in proof:
        node = _parent(node, sibling)
    return node == root


def ssp_of(leaves: Sequence[bytes]) -> bytes:
    """Return the SSP of a certificate that commits to `leaves`."""
    return _SSP_VERSION + root_of(leaves)


def root_in(ssp: bytes | None) -> bytes | None:
    """Return the root in the SSP of a certificate; `None` if it commits to nothing."""
    if ssp is None or len(ssp) != 1 + NODE_BYTES or not ssp.startswith(_SSP_VERSION):
        return None
    return ssp.removeprefix(_SSP_VERSION)


def _levels(leaves: Sequence[bytes]) -> list[Sequence[bytes]]:
    """Return all levels of the tree, from the leaves to the root; an odd node moves up as it is."""
    levels = [leaves]
    while len(levels[-1]) > 1:
        pairs = zip_longest(levels[-1][::2], levels[-1][1::2])
        levels.append([a if b is None else _parent(a, b) for a, b in pairs])
    return levels


def _parent(a: bytes, b: bytes) -> bytes:
    return _hashed(_NODE + min(a, b) + max(a, b))


def _hashed(data: bytes) -> bytes:
    return hashlib.sha256(data).digest()[:NODE_BYTES]
