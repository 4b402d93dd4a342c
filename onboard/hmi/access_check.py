"""Who may see the page: decided from the request's own words, before anything is answered.

Without a token only this machine is served, and a page of another origin that a browser on this
machine has open must not look either. Two ways it could: by a name of its own that resolves to
this machine (so it must be asked for by address), and by a web socket, which browsers let cross
origins (so its origin must be the page).
"""

import hmac
from ipaddress import ip_address
from urllib.parse import urlsplit


class AccessCheck:
    """Lets in, or says why not."""

    def __init__(self, token: str | None) -> None:
        """`token`: what to ask for; `None` asks for nothing, and is for this machine only."""
        self._token = token

    def refusal(
        self, host: str, origin: str | None, cookie: str | None, authorization: str | None
    ) -> str | None:
        """A short stable word why not, or `None`.

        Args:
            host: the `Host` header.
            origin: the `Origin` header; browsers send it where another origin may be behind it.
            cookie: what `cookie_for` once gave.
            authorization: the `Authorization` header.
        """
        if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
            return "foreign_origin"
        if self._token is None:
            return None if _is_this_machine(host) else "foreign_host"
        scheme, _, bearer = (authorization or "").partition(" ")
        offered = cookie if cookie is not None else bearer if scheme == "Bearer" else None
        if offered is None:
            return "no_token"
        return None if self.is_right(offered) else "wrong_token"

    def is_right(self, offered: str) -> bool:
        """Whether it is the token, in a time that does not tell how much of it is right."""
        token = self._token or ""
        return bool(token) and hmac.compare_digest(offered.encode(), token.encode())


def _is_this_machine(host: str) -> bool:
    """Whether it is asked for by an address of its own; any name may resolve to one."""
    try:
        name = urlsplit(f"//{host}").hostname
        return name == "localhost" or ip_address(name or "").is_loopback
    except ValueError:
        return False
