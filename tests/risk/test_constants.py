"""A constant's name means one thing in the package."""

import importlib
import pkgutil

import onboard.risk


def test_no_two_constants_of_one_name_have_different_values() -> None:
    values: dict[str, set[object]] = {}
    for module in pkgutil.iter_modules(onboard.risk.__path__):
        content = vars(importlib.import_module(f"onboard.risk.{module.name}"))
        for name, value in content.items():
            if name.isupper() and isinstance(value, int | float | str):
                values.setdefault(name, set()).add(value)

    assert {name: found for name, found in values.items() if len(found) > 1} == {}
