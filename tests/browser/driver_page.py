"""Opens the driver's page in a browser, at the sizes that the tests use."""

from typing import Any

import pytest
from playwright.sync_api import Browser, Page

PHONE = {"width": 390, "height": 844}
PHONE_ON_ITS_SIDE = {"width": 844, "height": 390}
SMALL_SCREEN = {"width": 800, "height": 480}
DESKTOP = {"width": 1280, "height": 800}

LISTEN = """
window.notes = [];
const start = OscillatorNode.prototype.start;
OscillatorNode.prototype.start = function (at) {
  notes.push({
    hz: this.frequency.value, at,
    audible: this.context.state === "running" && this.audible === true,
  });
  return start.call(this, at);
};
const connect = AudioNode.prototype.connect;
AudioNode.prototype.connect = function (to, ...rest) {
  this.before = this.before ?? [];
  if (to instanceof AudioNode) to.before = [...(to.before ?? []), this];
  const mark = (node) => { node.audible = true; (node.before ?? []).forEach(mark); };
  if (to instanceof AudioDestinationNode) mark(this);
  return connect.call(this, to, ...rest);
};
window.spoken = [];
speechSynthesis.speak = (utterance) => spoken.push(utterance.text);
"""
"""Records every note that is started, and whether its audio nodes are connected to the speaker."""


def open_page(browser: Browser, address: str, size: Any = PHONE, **more: Any) -> Page:
    """Open a page in a context of its own; errors and dialogs fail the test."""
    context = browser.new_context(viewport=size, **more)
    context.set_default_timeout(10_000)
    context.add_init_script(LISTEN)
    page = context.new_page()
    page.on("dialog", lambda dialog: pytest.fail(f"a dialog: {dialog.message}"))
    page.on("pageerror", lambda error: pytest.fail(f"an error in the page: {error}"))
    page.goto(address)
    return page
