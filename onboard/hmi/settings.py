"""Settings of the driver's page: address and access."""

from ipaddress import IPv4Address
from typing import Self

from pydantic import Field, SecretStr, model_validator

from onboard.settings import Settings


class HmiSettings(Settings):
    """The driver's page and the metrics, over HTTP."""

    host: IPv4Address = IPv4Address("127.0.0.1")
    """Local address to listen at. Any but 127.0.0.1 needs a `token`, since other devices of the
    network could open the page and press its button."""
    port: int = Field(8460, ge=1, le=65535)
    """Port of the page and of `/metrics`."""
    token: SecretStr | None = Field(None, min_length=16)
    """A browser sends it once in `http://HOST:PORT/?token=TOKEN`, Prometheus as bearer token. It
    has letters, digits, `-` and `_`."""
    brake_button: bool = False
    """Test mode: the page has the button of the LCCA paper's demonstration, which warns followers
    as if this vehicle braked hard."""

    recordings: bool = False
    """Serves the segments of the black box at `/recording`. Needs a `token`, since they have
    positions and pictures."""

    @model_validator(mode="after")
    def _others_need_a_token(self) -> Self:
        if self.token is None and not self.host.is_loopback:
            raise ValueError("a host other than 127.0.0.1 needs a token of at least 16 characters")
        if self.recordings and self.token is None:
            raise ValueError("recordings needs a token")
        if self.token is not None:
            text = self.token.get_secret_value()
            if not (text.isascii() and text.replace("-", "a").replace("_", "a").isalnum()):
                raise ValueError("token may have letters, digits, - and _")
        return self
