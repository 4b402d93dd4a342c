"""Answers in a drive wait until the box has asked under the same number."""

from onboard.messages.lcca import NO_ID, Answer, Inquiry, Join, LccaMessage, Reply, encode
from onboard.security import ieee1609dot2
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage
from sim_rig.boxes.awaited_answers import AwaitedAnswers
from sim_rig.boxes.played_drive import PlayedInput

OWN, AHEAD, OTHER = b"own-id--", b"ahead---", b"other---"
ANSWER = Answer(AHEAD, OWN, 7, b"temp", 15.0)
INQUIRY = Inquiry(OWN, 7, (AHEAD[:4],))


def wsm(message: LccaMessage) -> bytes:
    payload = ieee1609dot2.encode_unsecured(encode(message))
    return wsmp.encode(WaveShortMessage(psid=psid.LCCA, payload=payload))


def played(message: LccaMessage, at_s: float = 1.0) -> PlayedInput:
    return PlayedInput(at_s, "radio", wsm(message))


def test_an_answer_waits_for_its_inquiry() -> None:
    answers = AwaitedAnswers({OWN})
    assert answers.hold(played(ANSWER))
    assert answers.receive_wsm(wsm(Inquiry(OWN, 6, (AHEAD[:4],)))) == []
    assert answers.waiting == 1
    assert answers.receive_wsm(wsm(INQUIRY)) == [played(ANSWER)]
    assert answers.waiting == 0


def test_an_answer_after_its_inquiry_comes_at_its_own_time() -> None:
    answers = AwaitedAnswers({OWN})
    answers.receive_wsm(wsm(INQUIRY))
    assert not answers.hold(played(ANSWER))


def test_a_reply_waits_for_the_join_and_for_no_inquiry() -> None:
    answers = AwaitedAnswers({OWN})
    reply = Reply(AHEAD, AHEAD, 1, OWN, 7, 3, 15.0, NO_ID)
    assert answers.hold(played(reply))
    assert answers.receive_wsm(wsm(INQUIRY)) == []
    assert answers.receive_wsm(wsm(Join(OWN, AHEAD, 1, AHEAD, 7, NO_ID, 0))) == [played(reply)]


def test_all_copies_of_an_answer_are_released_together() -> None:
    answers = AwaitedAnswers({OWN})
    copies = [played(ANSWER, at_s) for at_s in (1.0, 1.1)]
    assert all(answers.hold(each) for each in copies)
    assert answers.receive_wsm(wsm(INQUIRY)) == copies


def test_nothing_else_waits() -> None:
    answers = AwaitedAnswers({OWN})
    to_another = Answer(AHEAD, OTHER, 7, b"temp", 15.0)
    noise = PlayedInput(1.0, "radio", b"\xff")
    picture = PlayedInput(1.0, "camera", wsm(ANSWER))
    for each in (played(to_another), played(INQUIRY), noise, picture):
        assert not answers.hold(each)
    assert not AwaitedAnswers(()).hold(played(ANSWER)), "without a camera it asks nothing"
