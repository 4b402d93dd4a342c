"""What axe-core finds in a page: names, roles, contrast from 4.5 on (WCAG 2), and its own rules."""

import pytest
from playwright.sync_api import Page


def violations(page: Page) -> list[str]:
    """A line for each element that breaks a rule; skips where axe-core is not installed."""
    axe = pytest.importorskip(
        "axe_playwright_python.sync_playwright", reason="no axe-core: `make test-pages` installs it"
    )
    found = axe.Axe().run(page).response["violations"]
    return [
        f"{rule['id']} ({rule['impact']}): {node['html'][:160]}"
        f" {[each['message'] for each in node['any']][:1]}"
        for rule in found
        for node in rule["nodes"]
    ]
