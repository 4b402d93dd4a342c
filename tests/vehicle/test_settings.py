"""Errors of a YAML file name the file, the field, the value and what is allowed."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal

import pytest
from pydantic import Field, SecretStr

from onboard.settings import MOST_MISTAKES, Settings, SettingsError, load_settings
from onboard.vehicle.config import CarConfig


class Colour(StrEnum):
    RED = "red"
    BLUE = "blue"


class Wheel(Settings):
    radius_m: float = Field(gt=0.0)
    colour: Colour = Colour.RED


class Ox(Settings):
    pulls: Literal["ox"]
    horns: int = 2


class Horse(Settings):
    pulls: Literal["horse"]
    saddle: Colour = Colour.RED
    bridle: SecretStr | None = Field(None, min_length=6)


class Cart(Settings):
    animal: Annotated[Ox | Horse, Field(discriminator="pulls")] | None = None
    seed: int = 0
    name: str = ""
    key: SecretStr = Field(default=SecretStr("enough"), min_length=6)
    wheels: tuple[Wheel, ...] = ()


@pytest.fixture
def yaml_file(tmp_path: Path) -> Path:
    return tmp_path / "cart.yaml"


def error_of(yaml_file: Path, text: str) -> str:
    yaml_file.write_text(text)
    with pytest.raises(SettingsError) as error:
        load_settings(yaml_file, Cart)
    return str(error.value)


def test_a_valid_file_becomes_settings(yaml_file: Path) -> None:
    yaml_file.write_text("seed: 3\nwheels: [{radius_m: 1, colour: blue}]\n")

    assert load_settings(yaml_file, Cart) == Cart(
        seed=3, wheels=(Wheel(radius_m=1.0, colour=Colour.BLUE),)
    )


def test_an_empty_file_gives_the_defaults(yaml_file: Path) -> None:
    yaml_file.write_text("")

    assert load_settings(yaml_file, Cart) == Cart()


ALIAS_BOMB = "v0: &v0 [1, 1, 1, 1]\n" + "".join(
    f"v{n}: &v{n} [{', '.join([f'*v{n - 1}'] * 4)}]\n" for n in range(1, 40)
)
"""A few lines that stand for 4^40 values."""


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "sead: 3",
            "sead: unknown key (given 3); allowed: animal, key, name, seed, wheels; did you mean",
        ),
        ("seed: three", "seed: Input should be a valid integer (given 'three')"),
        ("seed: 1.5", "seed: Input should be a valid integer"),
        ("wheels: [{}]", "wheels.0.radius_m: is required and missing"),
        (
            "wheels: [{radius_m: -1}]",
            "wheels.0.radius_m: Input should be greater than 0 (given -1)",
        ),
        ("wheels: [{radius_m: .nan}]", "wheels.0.radius_m: Input should be a finite number"),
        (
            "wheels: [{radius_cm: 1}]",
            "wheels.0.radius_cm: unknown key (given 1); allowed: colour, radius_m; did you mean",
        ),
        (
            "wheels: [{radius_m: 1, colour: pink}]",
            "wheels.0.colour: Input should be 'red' or 'blue' (given 'pink')",
        ),
        (
            "wheels: [{radius_m: 1}, {}, 3]",
            "wheels.2: needs a line `key: value` for each of its settings (given 3)",
        ),
        ("seed: {a: 1, b: 2}", "seed: Input should be a valid integer (given a, b)"),
        ("key: hush", "key: needs at least 6 characters"),
        ("key: 987654", "key: is a text, write it in quotes"),
        ("key: [987654]", "key: Input should be a valid string"),
        ("name: NO", "name: is a text, write it in quotes (YAML understood False)"),
        ("name: 00123", "name: is a text, write it in quotes (YAML understood 83)"),
        ("name: [a]", "name: Input should be a valid string (given ['a'])"),
        ("seed: 1\nseed: 2", "line 1, column 1: key 'seed' is repeated"),
        ("wheels: [&w {radius_m: 1}, {<<: *w}]", "line 1, column 29: << is not known here: write"),
        ("? [a]\n: 1", "not YAML: line 1, column 3: found unhashable key"),
        ("seed: [", "not YAML"),
        ("seed: 1\nname: 'a\nwheels: []", "line 2, column 7: this quote is not closed"),
        ("seed: 1\nname a\nwheels: []", "line 2, column 1: a key needs a colon and a space after"),
        ("seed:\nname: a", "line 1, column 1: seed is empty: give it a value ({} for a section"),
        (
            "animal: {pulls: hors}",
            "animal.pulls: Input should be one of 'ox', 'horse' (given 'hors'",
        ),
        ("animal: {pulls: hors}", "; did you mean horse?"),
        ("animal: {}", "animal.pulls: is required and missing; allowed: horse, ox"),
        ("animal: {pulls: horse, saddle: pink}", "animal.saddle: Input should be 'red' or 'blue'"),
        (
            "animal: {pulls: horse, sadle: red}",
            "animal.sadle: unknown key (given 'red'); allowed: br",
        ),
        ("animal: {pulls: horse, bridle: hush}", "animal.bridle: needs at least 6 characters"),
        ("wheels:\n\t- 1", "line 2, column 1: found character '\\t' that cannot start any token"),
        ("seed: 2026-02-31", "not YAML: day is out of range for month"),
        ("2026-02-03: 1", "keys must be str, int, float, bool or None, not date"),
        ("seed: &own {again: *own}", "Circular reference detected"),
        (ALIAS_BOMB, "line 7, column 10: aliases stand for more than 10000 values"),
        ("seed: " + "[" * 2000, "nested too deeply"),
        ("key: hush\nseed: " + "[" * 250 + "]" * 250, "nested too deeply"),
        ('key: hush\nname: "\\ud800"', "surrogates not allowed"),
        ("seed: " + "9" * 5000, "not YAML: Exceeds the limit"),
        (
            "just a sentence",
            "(the whole file): needs a line `key: value` for each of its settings (given 'just a",
        ),
    ],
)
def test_an_error_names_file_and_field_and_no_secret(
    yaml_file: Path, text: str, expected: str
) -> None:
    message = error_of(yaml_file, text)

    assert expected in message
    assert message.startswith(str(yaml_file))
    assert "hush" not in message
    assert "987654" not in message


def test_a_null_that_is_written_out_is_a_value(yaml_file: Path) -> None:
    yaml_file.write_text("animal: null\nname: ''\n")

    assert load_settings(yaml_file, Cart) == Cart()


def test_every_mistake_has_a_line(yaml_file: Path) -> None:
    assert len(error_of(yaml_file, "sead: 1\nseed: x\n").splitlines()) == 2


def test_of_many_mistakes_the_first_have_a_line_and_the_others_are_counted(
    yaml_file: Path,
) -> None:
    """A dictionary that is taken for settings filled the screen, after minutes."""
    lines = error_of(yaml_file, "".join(f"word{n}: {n}\n" for n in range(2000))).splitlines()

    assert len(lines) == MOST_MISTAKES + 1
    assert lines[-1] == f"{yaml_file}: more mistakes: {2000 - MOST_MISTAKES}"


def test_a_missing_file_is_an_error_that_names_it(yaml_file: Path) -> None:
    with pytest.raises(SettingsError, match=r"cart\.yaml: cannot be read: No such file"):
        load_settings(yaml_file, Cart)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"\x89PNG\r\n\x1a\n", "it is a PNG picture (onboard see)"),
        (b"\0\0\0\x20ftypisom\xff", "it is a video (onboard see)"),
        ("seed: 1\n".encode("utf-16"), "it is UTF-16 text; save it as UTF-8"),
        (b"seed: 1\n# caf\xe9\n", "line 2 is not UTF-8 (byte 0xe9); save it as UTF-8"),
    ],
)
def test_a_file_that_is_no_text_is_named_by_its_kind(
    yaml_file: Path, data: bytes, reason: str
) -> None:
    yaml_file.write_bytes(data)
    with pytest.raises(SettingsError) as error:
        load_settings(yaml_file, Cart)

    assert str(error.value) == f"{yaml_file}: not YAML: {reason}"


def test_of_a_long_wrong_value_the_start_is_shown(yaml_file: Path) -> None:
    assert len(error_of(yaml_file, f"seed: {'x' * 5000}\n")) < 500


def test_a_scenario_that_is_given_as_a_configuration_names_the_command_for_it(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("title: A drive.\ncars: {red: {plate: RD288HX}}\n", encoding="utf-8")

    with pytest.raises(SettingsError) as error:
        load_settings(path, CarConfig)

    assert str(error.value).endswith(f"sim-rig run {path}")
    assert "\n" not in str(error.value)
