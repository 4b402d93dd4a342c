"""The browser of the page tests, which are skipped without one."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, sync_playwright

from tools import chromium


@pytest.fixture(scope="session")
def chromium_path() -> str:
    """Path of chromium."""
    path = chromium.find()
    if path is None:
        pytest.skip(chromium.HOW)
    return path


@pytest.fixture(scope="module")
def browser(chromium_path: str) -> Iterator[Browser]:
    """One browser a module, since playwright's event loop blocks others."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium_path, args=chromium.ARGUMENTS)
        yield browser
        browser.close()
