"""The driver file: kept between drives, readable by its owner only."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.access.driver_file import DriverFile, load_driver, save_driver
from onboard.access.driver_model import DEFAULT_POPULATION, DriverModel
from onboard.errors import UserError
from onboard.settings import SettingsError


def test_the_next_drive_continues_with_the_model(tmp_path: Path) -> None:
    path = tmp_path / "driver.json"
    driver = load_driver(path, DEFAULT_POPULATION)
    for _ in range(12):
        driver.receive_reaction(1.8, 1.3)
    save_driver(path, driver)

    again = load_driver(path, DEFAULT_POPULATION)

    assert again.observed == 12
    assert again.log_reaction(0.9) == driver.log_reaction(0.9)
    assert path.stat().st_mode & 0o077 == 0
    assert [file.name for file in tmp_path.iterdir()] == ["driver.json"]


def test_after_deletion_the_model_is_that_of_the_population(tmp_path: Path) -> None:
    path = tmp_path / "driver.json"
    driver = DriverModel(DEFAULT_POPULATION)
    driver.receive_reaction(1.8, 1.3)
    save_driver(path, driver)
    path.unlink()

    assert load_driver(path, DEFAULT_POPULATION).log_reaction(1.0) == (
        DriverModel(DEFAULT_POPULATION).log_reaction(1.0)
    )


def test_a_missing_folder_is_an_error_that_names_the_file(tmp_path: Path) -> None:
    path = tmp_path / "nowhere" / "driver.json"

    with pytest.raises(UserError, match=r"driver\.json: cannot be written: No such file"):
        save_driver(path, DriverModel(DEFAULT_POPULATION))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "offset"),
        ("{", "not YAML"),
        ('{"offset":[0,0],"covariance":[[1,2],[2,1]],"observed":1}', "positive definite"),
        ('{"offset":[0,0],"covariance":[[1,0.1],[0.2,1]],"observed":1}', "symmetric"),
        ('{"offset":[0,.inf],"covariance":[[1,0],[0,1]],"observed":1}', "offset"),
        ('{"offset":[0,0],"covariance":[[1,0],[0,1]],"observed":-1}', "observed"),
    ],
)
def test_an_invalid_file_is_an_error_that_names_the_field(
    tmp_path: Path, text: str, message: str
) -> None:
    path = tmp_path / "driver.json"
    path.write_text(text, encoding="utf-8")

    with pytest.raises(SettingsError, match=message) as caught:
        load_driver(path, DEFAULT_POPULATION)

    assert str(path) in str(caught.value)


@given(st.lists(st.tuples(st.floats(0.15, 6.0), st.floats(0.05, 50.0)), max_size=200))
def test_any_learned_state_can_be_stored_and_loaded(reactions: list[tuple[float, float]]) -> None:
    driver = DriverModel(DEFAULT_POPULATION)
    for reaction in reactions:
        driver.receive_reaction(*reaction)

    again = DriverModel(DEFAULT_POPULATION, memory=driver.memory())

    assert again.memory() == driver.memory()


def test_a_file_that_cannot_be_read_is_left_as_it_is_and_reported(tmp_path: Path) -> None:
    path = tmp_path / "driver.json"
    path.write_text("{")

    file = DriverFile(path, DEFAULT_POPULATION)

    assert file.driver.observed == 0
    with pytest.raises(UserError, match=r"driver\.json: not YAML"):
        file.save()
    assert path.read_text() == "{"


def test_without_a_file_nothing_is_kept() -> None:
    DriverFile(None, DEFAULT_POPULATION).save()
