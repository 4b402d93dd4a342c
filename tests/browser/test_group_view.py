"""The second view of the driver's page in a real browser: members and messages."""

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from onboard.messages.exchanged import MessageReceived
from tests.browser.driver_page import DESKTOP, PHONE, PHONE_ON_ITS_SIDE, SMALL_SCREEN, open_page
from tests.hmi.row import Row

pytestmark = pytest.mark.browser

HOSTILE = "<img src=x onerror=alert(1)>"


@pytest.fixture(scope="module")
def row() -> Iterator[Row]:
    with Row("GN417KB", "RD288HX", "BL635TN", gap_m=13.6) as row:
        yield row


def open_group(browser: Browser, row: Row, size: Any = PHONE) -> Page:
    """Open the page and touch the tab of the group."""
    page = open_page(browser, row.address, size, has_touch=True)
    expect(page.locator("#state")).to_have_text("Member 3")
    page.tap("#group-tab")
    return page


@pytest.fixture
def page(browser: Browser, row: Row) -> Iterator[Page]:
    page = open_group(browser, row)
    yield page
    page.context.close()


def test_a_page_shows_the_driving_view_until_the_other_tab_is_touched(page: Page) -> None:
    expect(page.locator("#members")).to_be_visible()
    expect(page.locator("#driving")).to_be_hidden()

    page.reload()

    expect(page.locator("#gap")).to_have_text("14")
    expect(page.locator("#group-view")).to_be_hidden()


def test_the_tabs_are_reached_by_keyboard(browser: Browser, row: Row) -> None:
    page = open_page(browser, row.address)
    expect(page.locator("#gap")).to_have_text("14")

    page.keyboard.press("Tab")
    expect(page.locator("#driving-tab")).to_be_focused()
    page.keyboard.press("ArrowRight")

    expect(page.locator("#group-tab")).to_be_focused()
    expect(page.locator("#group-tab")).to_have_attribute("aria-selected", "true")
    expect(page.locator("#members li")).to_have_count(3)
    page.keyboard.press("ArrowRight")
    expect(page.locator("#gap")).to_be_visible()
    page.context.close()


def test_the_members_are_shown_with_their_states(page: Page) -> None:
    members = page.locator("#members li")

    expect(members).to_have_count(3)
    for number, state in enumerate(("Leader", "Member", "Member")):
        expect(members.nth(number).locator(".number")).to_have_text(str(number + 1))
        expect(members.nth(number).locator(".member-state")).to_have_text(state)
    expect(members.nth(0).locator(".age")).to_contain_text("s ago")
    expect(members.nth(1)).to_contain_text("warns you")
    expect(members.nth(2)).to_contain_text("This car")


def test_the_messages_of_the_vehicles_nearby_are_shown_in_words(page: Page) -> None:
    messages = page.locator("#messages li")

    expect(messages.filter(has_text="accepts this car")).to_contain_text("number 2 · 54 km/h")
    expect(messages.filter(has_text="follows")).to_have_count(1)


def test_a_member_that_brakes_hard_is_marked_and_the_alarm_covers_the_view(
    page: Page, row: Row
) -> None:
    row.brake()

    expect(page.locator("#alarm-headline")).to_have_text("Brake!")
    expect(page.locator("#members .brakes")).to_contain_text("Leader")
    expect(page.locator("#messages .warn").first).to_contain_text("number 1 brakes")
    row.brake(is_over=True)
    expect(page.locator("#alarm")).to_be_hidden()
    expect(page.locator("#members .brakes")).to_have_count(0)


def test_a_field_without_a_text_of_its_own_is_shown_and_no_html(page: Page, row: Row) -> None:
    content = {"sender_id": "ab" * 8, "lane_width_m": 3.519, "remark": HOSTILE}
    row.send_event(MessageReceived(row.now, "inquiry", None, content))

    row_of_it = page.locator("#messages li", has_text="abab")
    expect(row_of_it.locator("small")).to_have_text(f"lane width 3.52 m · remark {HOSTILE}")
    assert page.locator("img").count() == 0


@pytest.mark.parametrize("size", [PHONE, PHONE_ON_ITS_SIDE, SMALL_SCREEN, DESKTOP])
def test_the_lists_fit_on_the_screen(browser: Browser, row: Row, size: Any) -> None:
    page = open_group(browser, row, size)
    expect(page.locator("#members li")).to_have_count(3)

    outside = page.evaluate(
        """() => [...document.querySelectorAll("header *, .group-view section, .group-view li *")]
            .filter((e) => {
                const box = e.getBoundingClientRect();
                return box.left < -1 || box.right > innerWidth + 1
                    || e.scrollWidth > e.clientWidth + 2 && e.clientWidth > 0;
            }).map((e) => `${e.tagName} ${e.id} ${e.className}`)"""
    )

    host_is_reached = page.evaluate(
        """() => {
            const list = document.querySelector("#members").getBoundingClientRect();
            document.querySelector("#members .host").scrollIntoView();
            const host = document.querySelector("#members .host").getBoundingClientRect();
            return host.top >= list.top - 1 && host.bottom <= list.bottom + 1;
        }"""
    )
    page.context.close()
    assert outside == []
    assert host_is_reached
