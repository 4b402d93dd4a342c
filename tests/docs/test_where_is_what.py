"""The map of the design page leads a newcomer to the file that answers his question."""

import re

import pytest

from tests.docs.test_pages import ROOT

PAGE = (ROOT / "docs/design/README.md").read_text(encoding="utf-8")
MAP = PAGE.partition("## Where is what\n")[2].partition("\n## ")[0]
LINES = [" ".join(each.split()) for each in re.split(r"(?m)^- ", MAP)[1:]]

QUESTIONS = {
    "rate control": ("onboard/bsm_transmission/schedule.py", "MAXIMUM_INTERVAL_S = "),
    "path history": ("onboard/bsm_transmission/path_history.py", "class PathHistoryKeeper"),
    "width of a plate to distance": ("onboard/vision/plates.py", "locate_widths("),
    "pseudonym period": ("onboard/security/settings.py", "epoch_s: "),
    "who may not be believed": ("onboard/misbehaviour", ""),
    "how long a speed": ("onboard/sensors/host_state.py", "SPEED_VALID_S = "),
    "axes": ("sim_rig/studies/campaigns/study.py", "Axes"),
    "what an alarm needs": ("onboard/risk/application.py", "class Application"),
}
"""By words of a line: a file or folder that it names, and what stands there."""


@pytest.mark.parametrize("question", QUESTIONS)
def test_a_question_leads_to_the_file_with_its_answer(question: str) -> None:
    path, answer = QUESTIONS[question]
    (line,) = (each for each in LINES if question in each.partition("]: ")[0])

    assert f"`{path}`" in line
    assert not answer or answer in (ROOT / path).read_text(encoding="utf-8")
    assert (ROOT / path).exists()


def test_every_line_has_a_page_and_a_file() -> None:
    assert len(LINES) > 20
    assert [each for each in LINES if not re.search(r"\]\(\S+\.md", each)] == []
