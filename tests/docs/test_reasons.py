"""Every reason for which the code discards a message is explained on the page that lists them."""

import re

import pytest

from tests.docs.test_pages import ROOT

REASONS = {
    "docs/lcca.md": ("onboard/lcca", r'(?:_discard\(|return |refusal(?:: \S.*?)? = )"([a-z_]+)"'),
    "docs/design/intersections.md": ("onboard/intersections", r'DecodeError\(\s*"([a-z_]+)"'),
}
"""By page: the folder that discards, and how its code states a reason."""


@pytest.mark.parametrize("page", REASONS)
def test_every_reason_is_explained(page: str) -> None:
    folder, stated = REASONS[page]
    reasons = {
        reason
        for path in (ROOT / folder).glob("*.py")
        for reason in re.findall(stated, path.read_text(encoding="utf-8"))
    }
    text = (ROOT / page).read_text(encoding="utf-8")

    assert len(reasons) > 5
    assert {each for each in reasons if f"`{each}`" not in text} == set()
