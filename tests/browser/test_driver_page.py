"""The driver's page in a real browser, with vehicles in real time."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from onboard.observations import Impairment, Sensor, SensorImpaired, SensorLost
from onboard.recorder.records import RecorderState
from onboard.risk.alarm import Alarm, Cause, Level
from onboard.risk.eebl import EEBL
from onboard.risk.fcw import FCW
from onboard.risk.ima import IMA
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject
from tests.browser.accessibility import violations
from tests.browser.driver_page import (
    DESKTOP,
    PHONE,
    PHONE_ON_ITS_SIDE,
    SMALL_SCREEN,
    open_page,
)
from tests.hmi.row import Row

pytestmark = pytest.mark.browser

TOKEN = "aaaabbbbccccdddd"  # noqa: S105 (of this test)
HOSTILE = "<img src=x onerror=alert(1)>"


@pytest.fixture(scope="module")
def shared_row() -> Iterator[Row]:
    with Row("GN417KB", "RD288HX", "BL635TN", gap_m=13.6, brake_button=True) as row:
        yield row


@pytest.fixture
def row(shared_row: Row) -> Row:
    """The shared row, reset to its initial state."""
    shared_row.camera_works, shared_row.lead_plate = True, "RD288HX"
    shared_row.detections, shared_row.candidates = (), ()
    return shared_row


@pytest.fixture
def page(browser: Browser, row: Row) -> Iterator[Page]:
    page = open_page(browser, row.address)
    expect(page.locator("#state")).to_have_text("Member 3")
    yield page
    page.context.close()


def alarm(row: Row, cause: Cause, level: Level) -> None:
    row.send_event(Alarm(row.now, cause, level, 5.0, ()))


def notes(page: Page) -> list[dict[str, Any]]:
    """Return the notes so far, at least the four of a warning."""
    for _ in range(500):
        found: list[dict[str, Any]] = page.evaluate("notes")
        if len(found) >= 4:
            return found
        page.wait_for_timeout(20)
    raise AssertionError("no sound of a warning")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("level", [Level.NONE, Level.CAUTION, Level.WARNING])
def test_the_page_breaks_no_rule_of_accessibility(
    browser: Browser, row: Row, scheme: Any, level: Level
) -> None:
    page = open_page(browser, row.address, color_scheme=scheme)
    expect(page.locator("#state")).to_have_text("Member 3")
    alarm(row, FCW, level)
    expect(page.locator("body")).to_have_attribute("data-alarm", level)
    expect(page.locator("body")).to_have_attribute("data-link", "live")

    assert violations(page) == []
    alarm(row, FCW, Level.NONE)
    page.context.close()


def test_the_page_shows_the_group_number_and_the_gap(page: Page) -> None:
    expect(page.locator("#state-note")).to_contain_text("2 cars ahead warn you")
    expect(page.locator("#gap")).to_have_text("14")
    expect(page.locator("#gap-note")).to_have_text("0.9 s · safe from 30 m")
    expect(page.locator("#speed")).to_have_text("54")
    expect(page.locator("#road .plate-text")).to_have_text("RD288HX")
    expect(page.locator("#stale")).to_be_hidden()
    expect(page.locator("#alarm")).to_be_hidden()


def test_a_plate_that_is_asked_for_is_shown_once_its_car_answers(page: Page, row: Row) -> None:
    label = page.locator("#road").get_by_text("plates asked: 2", exact=True)

    row.candidates = ("RD288NX", "R0288NX")
    expect(label).to_be_visible()
    expect(page.locator("#road .plate-text")).to_have_count(0)
    row.candidates = ("RD288NX", "RD288HX")

    expect(page.locator("#road .plate-text")).to_have_text("RD288HX")
    expect(label).to_have_count(0)


@pytest.mark.parametrize("size", [PHONE, PHONE_ON_ITS_SIDE, SMALL_SCREEN, DESKTOP])
@pytest.mark.parametrize("level", [Level.NONE, Level.CAUTION, Level.WARNING])
def test_everything_fits_on_the_screen(browser: Browser, row: Row, size: Any, level: Level) -> None:
    page = open_page(browser, row.address, size)
    expect(page.locator("#stale")).to_be_hidden()
    if level is not Level.NONE:
        alarm(row, FCW, level)
        expect(page.locator("#alarm")).to_be_visible()

    outside = page.evaluate(
        """() => [...document.querySelectorAll("header *, main p, .sign, footer *")].filter((e) => {
            const box = e.getBoundingClientRect();
            return box.width > 0 && (box.left < -1 || box.top < -1
                || box.right > innerWidth + 1 || box.bottom > innerHeight + 1
                || e.scrollWidth > e.clientWidth + 2 && e.clientWidth > 0);
        }).map((e) => `${e.tagName} ${e.id} ${e.className}`)"""
    )

    alarm(row, FCW, Level.NONE)
    page.context.close()
    assert outside == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_has_enough_contrast_by_day_and_by_night(
    browser: Browser, row: Row, scheme: Any
) -> None:
    """Contrast as WCAG 2.2 defines it; 4.5 is its level AA for text of any size."""
    page = open_page(browser, row.address, color_scheme=scheme)

    contrasts = page.evaluate(
        """() => {
            const style = getComputedStyle(document.documentElement);
            const luminance = (name) => {
                const hex = style.getPropertyValue(name).trim();
                const [r, g, b] = [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255)
                    .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
                return 0.2126 * r + 0.7152 * g + 0.0722 * b;
            };
            const pairs = [["--on-warning", "--warning"], ["--on-caution", "--caution"]];
            for (const ink of ["--ink", "--soft", "--safe", "--close", "--tight"])
                for (const ground of ["--panel", "--ground"]) pairs.push([ink, ground]);
            return pairs.map(([ink, ground]) => {
                const [low, high] = [luminance(ink), luminance(ground)].sort((a, b) => a - b);
                return [`${ink} on ${ground}`, (high + 0.05) / (low + 0.05)];
            });
        }"""
    )

    page.context.close()
    assert {pair: ratio for pair, ratio in contrasts if not ratio >= 4.5} == {}


def test_chosen_colours_are_kept_after_a_reload(page: Page) -> None:
    root = page.locator("html")
    expect(root).to_have_attribute("data-colours", "day")
    page.click("#colours")
    page.click("#colours")
    expect(root).to_have_attribute("data-colours", "night")

    page.reload()

    expect(root).to_have_attribute("data-colours", "night")


def test_a_hard_braking_vehicle_raises_alarm_sound_and_speech(page: Page, row: Row) -> None:
    expect(page.locator("#sound")).to_contain_text("Sound is off")
    page.click("#sound")
    page.click("#voice")
    expect(page.locator("#sound-word")).to_be_hidden()

    row.brake()

    expect(page.locator("#alarm")).to_be_visible()
    expect(page.locator("#alarm-headline")).to_have_text("Brake!")
    expect(page.locator("#alarm-sentence")).to_have_text("Hard braking, 2 cars ahead")
    first = notes(page)[:4]
    assert all(note["audible"] for note in first)
    assert all(lower["hz"] < higher["hz"] for lower, higher in pairwise(first))
    assert page.evaluate("spoken") == ["Brake! Hard braking, 2 cars ahead"]

    row.brake(is_over=True)
    expect(page.locator("#alarm")).to_be_hidden()


def test_a_warning_by_the_button_is_shown_as_a_test(page: Page, row: Row) -> None:
    row.press_button()

    expect(page.locator("#alarm-headline")).to_have_text("Test")
    expect(page.locator("#alarm-sentence")).to_have_text("A driver ahead tests the warning")
    expect(page.locator("#alarm")).to_be_hidden()


def test_before_the_first_touch_the_page_shows_that_sound_is_off(page: Page, row: Row) -> None:
    alarm(row, IMA, Level.WARNING)
    expect(page.locator("#alarm-headline")).to_have_text("Stop!")
    assert page.evaluate("notes") == []
    expect(page.locator("#sound")).to_have_text("Sound is off: tap")

    page.click("#sound")

    assert len(notes(page)) >= 4
    alarm(row, IMA, Level.NONE)
    expect(page.locator("#alarm")).to_be_hidden()


def test_each_level_has_the_pitches_of_its_pattern(page: Page) -> None:
    """Rendered by the browser's audio engine; the pitch is counted from zero crossings."""
    measured = page.evaluate(
        """async () => {
            const { PATTERNS, schedule } = await import("/sounds.js");
            const measured = {};
            for (const [level, pattern] of Object.entries(PATTERNS)) {
                const length_s = pattern.note_s * pattern.notes_hz.length;
                const context = new OfflineAudioContext(1, 44100 * length_s, 44100);
                schedule(context, pattern, 0);
                const samples = (await context.startRendering()).getChannelData(0);
                measured[level] = pattern.notes_hz.map((_, index) => {
                    const from = Math.round((index * pattern.note_s + 0.02) * 44100);
                    const to = Math.round(((index + 1) * pattern.note_s - 0.03) * 44100);
                    let crossings = 0;
                    for (let at = from + 1; at < to; at += 1)
                        crossings += (samples[at - 1] < 0) !== (samples[at] < 0);
                    return [pattern.notes_hz[index], crossings / 2 / ((to - from) / 44100)];
                });
            }
            return measured;
        }"""
    )

    for notes in measured.values():
        for pattern_hz, measured_hz in notes:
            assert measured_hz == pytest.approx(pattern_hz, rel=0.03)
    highest = {level: max(hz for _, hz in notes) for level, notes in measured.items()}
    assert highest["stale"] < highest["caution"] < highest["warning"]


def test_a_lost_camera_is_shown_at_once_and_the_gap_disappears(page: Page, row: Row) -> None:
    row.lose_camera()

    expect(page.locator("#sensors .lost")).to_have_text("Camera lostimage frozen")
    expect(page.locator("#gap")).to_have_text("\N{EN DASH}")
    expect(page.locator("#gap-note")).to_have_text("Unknown without the camera")
    expect(page.locator("#road .plate-text")).to_have_count(0)

    row.camera_works = True
    expect(page.locator("#sensors .lost")).to_have_count(0)
    expect(page.locator("#state")).to_have_text("Member 3")


def test_a_camera_that_is_dirty_and_turned_is_shown_as_such(page: Page, row: Row) -> None:
    impairments = Impairment.DIRTY, Impairment.TURNED
    row.send_event(SensorImpaired(row.now, Sensor.CAMERA, impairments))
    expect(page.locator("#sensors .lost")).to_have_text(
        "Cameraview dirty, or fog; turned: calibrate it"
    )
    row.send_event(SensorImpaired(row.now, Sensor.CAMERA, ()))
    expect(page.locator("#sensors .lost")).to_have_count(0)


def test_a_lane_that_is_not_seen_to_be_free_is_no_free_lane(page: Page, row: Row) -> None:
    row.sees_lane = False

    expect(page.locator("#gap-note")).to_have_text("Car ahead? The camera cannot tell")
    expect(page.locator("#road rect.unknown")).to_have_count(1)

    row.sees_lane = True
    expect(page.locator("#road rect.unknown")).to_have_count(0)
    expect(page.locator("#state")).to_have_text("Member 3")


def test_a_full_disk_is_shown(page: Page, row: Row) -> None:
    row.send_event(RecorderState(row.now, is_recording=False, reason="disk full", dropped=3))
    expect(page.locator("#sensors .lost")).to_have_text("Not recordingdisk full")
    row.send_event(RecorderState(row.now, is_recording=True, reason="", dropped=3))
    expect(page.locator("#sensors .lost")).to_have_count(0)


def test_a_page_without_data_shows_that_and_reconnects(page: Page, row: Row) -> None:
    page.click("#sound")
    alarm(row, FCW, Level.WARNING)
    expect(page.locator("#alarm")).to_be_visible()

    row.stop()

    expect(page.locator("#stale-headline")).to_have_text("No data")
    expect(page.locator("#alarm")).to_be_hidden()
    falling = [note["hz"] for note in page.evaluate("notes")][-2:]
    assert falling[0] > falling[1]

    row.start()

    expect(page.locator("#stale")).to_be_hidden()
    expect(page.locator("#state")).to_have_text("Member 3")


def test_received_texts_are_not_interpreted_as_html(page: Page, row: Row) -> None:
    row.lead_plate = HOSTILE
    expect(page.locator("#road .plate-text")).to_have_text(HOSTILE)
    row.send_event(SensorLost(row.now, Sensor.SPEED, 1.0, HOSTILE))
    expect(page.locator("#sensors .lost small")).to_have_text(HOSTILE)

    assert page.locator("img").count() == 0
    row.do(lambda: row.page.receive_event(SensorLost(row.now, Sensor.SPEED, 1.0, "silent")))


def test_the_brake_button_warns_followers_and_not_the_host_vehicle(page: Page, row: Row) -> None:
    page.click("#brake")

    metrics = page.context.request.get(f"{row.address}metrics")
    while 'onboard_messages_sent_total{message="warn"}' not in metrics.text():
        metrics = page.context.request.get(f"{row.address}metrics")
    expect(page.locator("#alarm")).to_be_hidden()


def perceived_object(east_m: float, north_m: float, source: ObjectSource) -> PerceivedObject:
    state = (east_m, north_m, -10.0, 0.0) if source is not ObjectSource.HOST else (0, 0, 0, 15.0)
    return PerceivedObject(0.0, str(east_m), source, state, ((0.0,) * 4,) * 4, 0.1, frozenset())


@pytest.mark.parametrize("size", [PHONE, PHONE_ON_ITS_SIDE, DESKTOP])
def test_vehicles_beside_are_on_the_map_in_the_order_of_their_distances(
    browser: Browser, row: Row, size: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Up to 80 m away, and one in the next lane."""
    host = perceived_object(0.0, 0.0, ObjectSource.HOST)
    beside = [
        perceived_object(right_m, 22.0, ObjectSource.BSM) for right_m in (-80.0, -25.0, 3.5, 40.0)
    ]
    display = row.page._display
    receive = display.receive_surroundings
    monkeypatch.setattr(display, "receive_surroundings", lambda *_: receive(host, beside))
    page = open_page(browser, row.address, size)
    expect(page.locator(".vehicle.bsm")).to_have_count(4)

    frame, boxes = page.evaluate(
        """() => [document.querySelector("#road"), ...document.querySelectorAll(".vehicle.bsm")]
            .map((e) => e.getBoundingClientRect()).map(({ left, right }) => [left, right])
            .reduce(([frame, boxes], box) => frame ? [frame, [...boxes, box]] : [box, boxes],
                [null, []])"""
    )

    page.context.close()
    middles = sorted((left + right) / 2 - sum(frame) / 2 for left, right in boxes)
    assert middles[0] < middles[1] < 0 < middles[2] < middles[3]
    assert all(frame[0] <= left and right <= frame[1] for left, right in boxes)


def test_twenty_pages_show_the_same_alarm(browser: Browser, row: Row) -> None:
    pages = [open_page(browser, row.address)]
    for _ in range(19):
        pages.append(pages[0].context.new_page())
        pages[-1].goto(row.address)
    for page in pages:
        expect(page.locator("#stale")).to_be_hidden()

    alarm(row, EEBL, Level.WARNING)

    for page in pages:
        expect(page.locator("#alarm-sentence")).to_have_text("A car ahead brakes hard")
    alarm(row, EEBL, Level.NONE)
    pages[0].context.close()


def test_only_the_token_opens_the_page(browser: Browser) -> None:
    with Row("GN417KB", "RD288HX", token=TOKEN) as row:
        page = open_page(browser, row.address)
        expect(page.locator("body")).to_contain_text("needs its token")
        page.goto(f"{row.address}?token=aaaabbbbccccdddX")
        expect(page.locator("body")).to_contain_text("not the token")

        page.goto(f"{row.address}?token={TOKEN}")

        expect(page.locator("#state")).to_have_text("Member 2")
        assert TOKEN not in page.url
        page.context.close()
