"""Which requests are accepted, from their headers."""

import pytest

from onboard.errors import UserError
from onboard.hmi.access_check import AccessCheck
from onboard.hmi.settings import HmiSettings
from onboard.settings import parse_settings

TOKEN = "aaaabbbbccccdddd"  # noqa: S105 (of this test)


@pytest.mark.parametrize(
    "host",
    ["127.0.0.1:8460", "localhost:8460", "localhost", "127.0.0.1", "127.0.0.2:8460", "[::1]:8460"],
)
def test_without_a_token_this_computer_is_served(host: str) -> None:
    assert AccessCheck(None).refusal(host, None, None, None) is None
    assert AccessCheck(None).refusal(host, f"http://{host}", None, None) is None


def test_a_proxy_with_tls_is_served_under_its_own_name() -> None:
    assert AccessCheck(TOKEN).refusal("car.example", "https://car.example", TOKEN, None) is None


@pytest.mark.parametrize("host", ["evil.example:8460", "127.0.0.1.evil.example", "", "[::1", "@"])
def test_a_foreign_host_name_is_refused(host: str) -> None:
    assert AccessCheck(None).refusal(host, None, None, None) == "foreign_host"


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:9999"])
@pytest.mark.parametrize("token", [None, TOKEN])
def test_another_origin_is_refused(origin: str, token: str | None) -> None:
    assert AccessCheck(token).refusal("127.0.0.1:8460", origin, TOKEN, None) == "foreign_origin"


@pytest.mark.parametrize(
    ("cookie", "authorization", "refusal"),
    [
        (TOKEN, None, None),
        (None, f"Bearer {TOKEN}", None),
        (None, None, "no_token"),
        (None, f"Basic {TOKEN}", "no_token"),
        ("", None, "wrong_token"),
        (TOKEN + "x", None, "wrong_token"),
        (TOKEN[:-1], None, "wrong_token"),
        ("\N{SNOWMAN}", None, "wrong_token"),
        (None, "Bearer ", "wrong_token"),
    ],
)
def test_a_configured_token_is_required(
    cookie: str | None, authorization: str | None, refusal: str | None
) -> None:
    assert AccessCheck(TOKEN).refusal("192.168.7.1:8460", None, cookie, authorization) == refusal


@pytest.mark.parametrize(
    ("tree", "message"),
    [
        ({"host": "0.0.0.0"}, "needs a token"),  # noqa: S104 (which is refused)
        ({"host": "192.168.7.1"}, "needs a token"),
        ({"token": "short"}, "at least 16"),
        ({"token": "aaaa bbbb cccc dddd"}, "letters, digits"),
        ({"port": 0}, "greater than or equal to 1"),
        ({"prot": 1}, "did you mean port?"),
    ],
)
def test_invalid_settings_are_an_error(tree: dict[str, object], message: str) -> None:
    with pytest.raises(UserError, match=message):
        parse_settings(tree, HmiSettings, "hmi")


def test_another_address_with_a_token_is_accepted() -> None:
    settings = parse_settings({"host": "192.168.7.1", "token": TOKEN}, HmiSettings, "hmi")

    assert TOKEN not in repr(settings)
