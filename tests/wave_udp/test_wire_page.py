"""docs/wire.md agrees with the code."""

import json
import re
from pathlib import Path

import yaml

from onboard.settings import Settings, parse_settings
from onboard.tools.decode.describe import describe
from onboard.wave_udp.settings import RadioSettings
from tools.wire_tables import with_tables

PAGE = (Path(__file__).parents[2] / "docs" / "wire.md").read_text(encoding="utf-8")


class Car(Settings):
    radio: RadioSettings


def test_the_tables_of_the_page_are_those_of_the_declarations() -> None:
    assert with_tables(PAGE) == PAGE, "run python tools.wire_tables.py"


def test_the_example_decodes_to_what_the_page_shows() -> None:
    ((octets, shown),) = re.findall(
        r"^    ([0-9a-f]{60,})\n.*?^    (\{.*\})$", PAGE, re.MULTILINE | re.DOTALL
    )
    assert {"line": 1, **describe(bytes.fromhex(octets))} == json.loads(shown)


def test_every_radio_of_the_page_is_a_configuration() -> None:
    blocks = re.findall(r"(?ms)^```yaml\n(.*?)^```$", PAGE)
    radios = [parse_settings({"radio": yaml.safe_load(block)}, Car, "page") for block in blocks]
    assert [car.radio.endpoint for car in radios] == ["iwcu", "rsu41", "raw"]
