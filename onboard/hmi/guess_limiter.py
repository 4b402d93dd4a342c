"""How often a client may offer a wrong token, without I/O.

A client is an IPv4 address, or the network of an IPv6 address, of which a host has 2^64. Whoever
guesses shuts out himself, and who shares his address (behind a proxy, all do); a page that is open
stays open.
"""

from collections import OrderedDict
from ipaddress import IPv6Address, ip_address

GUESS_S = 1.0
"""Time after a wrong token until the next one is looked at, once `MOST_AT_ONCE` were offered."""
MOST_AT_ONCE = 10
"""Wrong tokens without a wait: mistakes of a user, and pages with an old cookie."""
MOST_CLIENTS = 1024
"""Clients that are remembered, those with the last wrong tokens."""

_HOST_BITS = 64


class GuessLimiter:
    """Wrong tokens by client; `now` is a monotonic clock in s."""

    def __init__(self) -> None:
        self._paid_at: OrderedDict[str | int, float] = OrderedDict()
        """When a client has waited for all its wrong tokens."""

    def may_offer(self, address: str | None, now: float) -> bool:
        """Return whether a token of this client is looked at now."""
        return self._paid_at.get(_client(address), now) <= now + (MOST_AT_ONCE - 1) * GUESS_S

    def receive_wrong(self, address: str | None, now: float) -> None:
        """Count a wrong token."""
        client = _client(address)
        self._paid_at[client] = max(self._paid_at.pop(client, now), now) + GUESS_S
        if len(self._paid_at) > MOST_CLIENTS:
            self._paid_at.popitem(last=False)


def _client(address: str | None) -> str | int:
    try:
        parsed = ip_address((address or "").partition("%")[0])
    except ValueError:
        return ""
    return int(parsed) >> _HOST_BITS if isinstance(parsed, IPv6Address) else str(parsed)
