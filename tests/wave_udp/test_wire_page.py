"""docs/wire.md says what the code does."""

import json
import re
from pathlib import Path

import pytest
import yaml

from onboard.messages.lcca import LAYOUTS
from onboard.settings import Settings, parse_settings
from onboard.wave_udp.decode import describe
from onboard.wave_udp.settings import RadioSettings

PAGE = (Path(__file__).parents[2] / "docs" / "wire.md").read_text(encoding="utf-8")


class Car(Settings):
    radio: RadioSettings


@pytest.mark.parametrize("code", LAYOUTS)
def test_the_lcca_tables_are_the_declarations(code):
    message = LAYOUTS[code].message
    title = f"**{message.__name__}** (type {code}, user priority {message.user_priority})"
    assert f"{title}\n\n{LAYOUTS[code].table()}\n" in PAGE


def test_the_example_decodes_to_what_the_page_shows():
    ((octets, shown),) = re.findall(
        r"^    ([0-9a-f]{60,})\n.*?^    (\{.*\})$", PAGE, re.MULTILINE | re.DOTALL
    )
    assert {"line": 1, **describe(bytes.fromhex(octets))} == json.loads(shown)


def test_every_radio_of_the_page_is_a_configuration():
    blocks = re.findall(r"(?ms)^```yaml\n(.*?)^```$", PAGE)
    radios = [parse_settings({"radio": yaml.safe_load(block)}, Car, "page") for block in blocks]
    assert [car.radio.endpoint for car in radios] == ["iwcu", "rsu41", "raw"]
