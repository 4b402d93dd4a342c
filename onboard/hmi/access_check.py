"""Access check of HTTP requests, from their headers alone.

Without a token only this computer is served. A page of another origin, open in a browser on this
computer, must get nothing either. It could try with a host name of its own that resolves to this
computer (DNS rebinding), so the requested host must be a loopback address. Or it could try with a
web socket, which browsers do not restrict by origin, so the origin must be the page itself.
"""

import hmac
from ipaddress import ip_address
from urllib.parse import urlsplit


class AccessCheck:
    """Accepts or refuses requests."""

    def __init__(self, token: str | None) -> None:
        """Require `token`; with `None`, serve this computer only."""
        self._token = token

    def refusal(
        self, host: str, origin: str | None, cookie: str | None, authorization: str | None
    ) -> str | None:
        """Return the reason of a refusal as a short word, or `None` if the request is accepted.

        Args:
            host: the `Host` header.
            origin: the `Origin` header, if the browser sent one.
            cookie: the value of the page's cookie, if the browser sent one.
            authorization: the `Authorization` header, if there is one.
        """
        if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
            return "foreign_origin"
        if self._token is None:
            return None if _is_loopback(host) else "foreign_host"
        scheme, _, bearer = (authorization or "").partition(" ")
        offered = cookie if cookie is not None else bearer if scheme == "Bearer" else None
        if offered is None:
            return "no_token"
        return None if self.is_token(offered) else "wrong_token"

    def is_token(self, offered: str) -> bool:
        """Compare with the token, in a time that does not depend on how many characters match."""
        token = self._token or ""
        # Bytes of a header that are no UTF-8 arrive as surrogates.
        given = offered.encode("utf-8", "surrogateescape")
        return bool(token) and hmac.compare_digest(given, token.encode())


def _is_loopback(host: str) -> bool:
    try:
        name = urlsplit(f"//{host}").hostname
        return name == "localhost" or ip_address(name or "").is_loopback
    except ValueError:
        return False
