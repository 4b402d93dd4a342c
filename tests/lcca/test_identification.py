"""Who is ahead: inquiries, answers, and the decision."""

from itertools import pairwise

import numpy as np
import pytest

from onboard.lcca.asking import ALL_ANSWERS_AT_ONCE, ALL_ANSWERS_PER_S, ANSWERS_AT_ONCE
from onboard.lcca.events import CandidateCar, Identified, IdentityLost, Inquired, TrackedLead
from onboard.lcca.identification import (
    ASK_HEADWAY_S,
    RETRY_MAX_S,
    RETRY_S,
    Identification,
)
from onboard.messages.lcca import MAX_NAMES, NAME_BYTES, Answer, Inquiry, decode, encode
from onboard.observations import Discarded
from tests.typed import a

OWN, AHEAD, TWIN, FAR = b"own-0000", b"ahead-00", b"twin-000", b"far-0000"
TEMPORARY = {OWN: b"t-ow", AHEAD: b"t-ah", TWIN: b"t-tw", FAR: b"t-fa"}
SPEED_M_S = 20.0
FRAME_S = 0.1


def candidate(car_id: bytes, probability: float) -> CandidateCar:
    return CandidateCar(f"TEXT{car_id[:1].decode().upper()}", car_id, probability)


class Drive:
    """One vehicle's identification, fed by hand at 10 images a second."""

    def __init__(self) -> None:
        self.core = Identification(OWN, TEMPORARY[OWN], np.random.default_rng(1))
        self.now = 0.0
        self.events: list[object] = []
        self.inquiries: list[Inquiry] = []

    def look(
        self,
        *candidates: CandidateCar,
        seconds: float = FRAME_S,
        track_id: int = 1,
        gap_m: float = 25.0,
        ahead_m_s: float = SPEED_M_S,
        answering: dict[bytes, float] | None = None,
    ) -> None:
        """Look at a lead for some time while others answer inquiries at their speeds."""
        for _ in range(round(seconds / FRAME_S)):
            self.core.receive_speed(SPEED_M_S, self.now)
            for car_id, speed_m_s in (answering or {}).items():
                temporary_id = TEMPORARY[car_id]
                self.core.receive_speed_on_air(temporary_id, temporary_id, speed_m_s, self.now)
            lead = TrackedLead(self.now, track_id, gap_m, SPEED_M_S - ahead_m_s, 0.3, candidates)
            self.core.receive_lead(lead, self.now)
            self.settle(answering or {})
            self.now += FRAME_S

    def settle(self, answering: dict[bytes, float]) -> None:
        for message in self.core.messages_to_send():
            assert isinstance(message, Inquiry)
            self.inquiries.append(message)
            for car_id, speed_m_s in answering.items():
                if {car_id[:NAME_BYTES], TEMPORARY[car_id]} & set(message.names):
                    self.answer(message, car_id, speed_m_s)
        while (event := self.core.next_event()) is not None:
            self.events.append(event)

    def answer(self, inquiry: Inquiry, car_id: bytes, speed_m_s: float = SPEED_M_S) -> None:
        answer = Answer(car_id, OWN, inquiry.sequence, TEMPORARY[car_id], speed_m_s)
        self.core.receive_message(answer, None, self.now)

    @property
    def identified(self) -> bytes | None:
        identity = self.core.identity
        return None if identity is None else identity.car_id

    def discarded(self) -> list[str]:
        self.settle({})
        return [event.reason for event in self.events if isinstance(event, Discarded)]


@pytest.mark.parametrize("probability", [0.98, 0.5])
def test_the_car_that_answers_is_identified_though_its_text_is_doubtful(probability: float) -> None:
    drive = Drive()
    others = candidate(FAR, 1.0 - probability)
    drive.look(candidate(AHEAD, probability), others, seconds=0.5, answering={AHEAD: SPEED_M_S})
    assert drive.identified == AHEAD
    (event,) = [each for each in drive.events if isinstance(each, Identified)]
    assert (event.text, event.cause) == ("TEXTA", "answer")


def test_an_unlikely_text_is_confirmed_by_an_answer_and_motion() -> None:
    drive = Drive()
    drive.look(candidate(AHEAD, 0.05), seconds=1.0, answering={AHEAD: SPEED_M_S})
    assert drive.identified is None
    for step in range(60):
        speed_m_s = SPEED_M_S + 2.0 * np.sin(step / 10.0)
        drive.look(candidate(AHEAD, 0.05), ahead_m_s=speed_m_s, answering={AHEAD: speed_m_s})
    assert drive.identified == AHEAD


def test_late_images_are_compared_with_the_own_speed_at_their_time() -> None:
    """The own car brakes at 3.5 m/s2 behind one at 11 m/s; its images come 0.2 to 0.6 s late."""
    drive, rng = Drive(), np.random.default_rng(2)
    names = candidate(AHEAD, 0.5), candidate(TWIN, 0.5)
    answering = {AHEAD: 11.0, TWIN: 9.0}

    def own_m_s(at_s: float) -> float:
        return float(np.interp(at_s, (1.0, 5.0), (25.0, 11.0)))

    image_s = 0.0
    for step in range(60):
        drive.now = step * FRAME_S
        drive.core.receive_speed(own_m_s(drive.now), drive.now)
        for car, speed_m_s in answering.items():
            drive.core.receive_speed_on_air(TEMPORARY[car], TEMPORARY[car], speed_m_s, drive.now)
        if drive.now >= image_s + rng.uniform(0.2, 0.6):
            closing_m_s = own_m_s(image_s) - 11.0
            lead = TrackedLead(image_s, 1, 20.0, closing_m_s, 0.3, names)
            drive.core.receive_lead(lead, drive.now)
            image_s = drive.now
        drive.settle(answering)
    assert {each.car_id for each in drive.events if isinstance(each, Identified)} <= {AHEAD}


def test_a_sharp_text_is_asked_for_and_believed_with_the_first_image() -> None:
    drive = Drive()
    drive.look(candidate(AHEAD, 0.9995), answering={AHEAD: SPEED_M_S})
    assert drive.identified == AHEAD


def test_a_doubtful_text_is_asked_for_twice_before_it_is_believed() -> None:
    drive = Drive()
    drive.look(candidate(AHEAD, 0.98), answering={AHEAD: SPEED_M_S})
    assert drive.identified is None
    drive.look(candidate(AHEAD, 0.98), seconds=0.3, answering={AHEAD: SPEED_M_S})
    assert drive.identified == AHEAD


def test_an_unlikely_text_is_asked_for_once_the_likelier_ones_stay_silent() -> None:
    drive = Drive()
    texts = candidate(FAR, 0.9985), candidate(AHEAD, 0.0005)
    drive.look(*texts, seconds=3.0, answering={AHEAD: SPEED_M_S})
    assert AHEAD[:NAME_BYTES] not in drive.inquiries[0].names
    assert drive.identified == AHEAD


def test_an_unlikely_text_waits_until_the_ids_of_the_others_are_derived() -> None:
    drive = Drive()
    both = {AHEAD: SPEED_M_S, TWIN: SPEED_M_S}
    drive.look(candidate(TWIN, 0.5), seconds=0.3, answering=both)
    drive.look(candidate(TWIN, 0.5), candidate(AHEAD, 0.3), seconds=0.3, answering=both)
    assert drive.identified is None
    alone = Drive()
    texts = candidate(AHEAD, 0.5), candidate(FAR, 0.5)
    alone.look(*texts, seconds=0.4, answering={AHEAD: SPEED_M_S})
    assert alone.identified is None
    alone.look(*texts, seconds=0.2, answering={AHEAD: SPEED_M_S})
    assert alone.identified == AHEAD


def test_what_nobody_answers_to_stays_unknown_and_is_asked_ever_more_rarely() -> None:
    drive = Drive()
    drive.look(candidate(AHEAD, 0.98), seconds=10.0)
    assert drive.identified is None
    times = [event.stamp_s for event in drive.events if isinstance(event, Inquired)]
    waits = np.diff(times)
    assert RETRY_S <= waits[0] <= 2 * RETRY_S + FRAME_S
    assert RETRY_MAX_S <= waits[-1] <= RETRY_MAX_S + 2 * FRAME_S
    assert len(times) < 16


def test_while_a_car_on_the_air_moves_as_the_lead_lost_answers_are_soon_asked_for_again() -> None:
    drive = Drive()
    for step in range(200):
        speed_m_s = SPEED_M_S + 2.0 * np.sin(step / 30.0)
        name = TEMPORARY[AHEAD]
        drive.core.receive_speed_on_air(name, name, speed_m_s, drive.now)
        drive.look(candidate(AHEAD, 0.98), ahead_m_s=speed_m_s)
    times = [event.stamp_s for event in drive.events if isinstance(event, Inquired)]
    assert np.diff(times)[-20:].max() < 0.55


def test_a_car_that_answers_but_drives_otherwise_is_not_believed() -> None:
    drive = Drive()
    drive.look(candidate(TWIN, 0.95), seconds=5.0, answering={TWIN: SPEED_M_S + 6.0})
    assert drive.identified is None


@pytest.mark.parametrize(("others", "images"), [(1, 10), (5, 15)])
@pytest.mark.parametrize("probability", [0.9, 0.95])
def test_insiders_that_move_as_the_lead_and_answer_nobody_hardly_delay_it(
    probability: float, others: int, images: int
) -> None:
    drive = Drive()
    insiders = {f"evil{number}".encode(): f"t-e{number}".encode() for number in range(others)}
    for step in range(images):
        ahead_m_s = SPEED_M_S + 2.0 * np.sin(step / 10.0)
        places = dict.fromkeys(insiders, (29.5, 0.0, 1.0))
        drive.core.receive_offsets(places)
        for sender, temporary_id in insiders.items():
            drive.core.receive_speed_on_air(sender, temporary_id, ahead_m_s, drive.now)
        texts = candidate(AHEAD, probability)
        drive.look(texts, ahead_m_s=ahead_m_s, answering={AHEAD: ahead_m_s})
    assert drive.identified == AHEAD


def test_two_answers_stay_undecided_until_the_texts_or_the_speeds_tell() -> None:
    drive = Drive()
    both = {AHEAD: SPEED_M_S, TWIN: SPEED_M_S}
    drive.look(candidate(AHEAD, 0.6), candidate(TWIN, 0.3), seconds=3.0, answering=both)
    assert drive.identified is None
    drive.look(candidate(AHEAD, 0.9995), candidate(TWIN, 1e-7), seconds=0.2, answering=both)
    assert drive.identified == AHEAD
    drive = Drive()
    drive.look(candidate(AHEAD, 0.3), candidate(TWIN, 0.6), seconds=1.0, answering=both)
    apart = {AHEAD: 16.0, TWIN: SPEED_M_S}
    drive.look(
        candidate(AHEAD, 0.3), candidate(TWIN, 0.6), seconds=3.0, ahead_m_s=16.0, answering=apart
    )
    assert drive.identified == AHEAD


def test_readings_of_a_tracked_car_change_nothing_once_it_is_identified() -> None:
    drive = Drive()
    drive.look(candidate(AHEAD, 0.9995), answering={AHEAD: SPEED_M_S, TWIN: SPEED_M_S})
    drive.look(candidate(TWIN, 0.98), seconds=10.0, answering={AHEAD: SPEED_M_S, TWIN: SPEED_M_S})
    assert drive.identified == AHEAD
    drive.look(seconds=10.0, answering={AHEAD: SPEED_M_S})
    assert drive.identified == AHEAD


def test_another_track_has_no_identity_and_a_former_one_has_its_own_again() -> None:
    drive = Drive()
    drive.look(candidate(AHEAD, 0.9995), answering={AHEAD: SPEED_M_S})
    drive.look(track_id=2, seconds=1.0)
    assert drive.identified is None
    drive.look(track_id=1)
    assert drive.identified == AHEAD
    drive.core.receive_lead(None, drive.now)
    assert drive.identified is None


def test_a_car_that_ceases_to_move_as_the_lead_is_dropped_within_seconds() -> None:
    drive = Drive()
    drive.look(candidate(AHEAD, 0.98), seconds=5.0, answering={AHEAD: SPEED_M_S})
    drive.look(
        candidate(TWIN, 0.98), seconds=3.0, ahead_m_s=13.0, answering={AHEAD: SPEED_M_S, TWIN: 13.0}
    )
    assert any(isinstance(each, IdentityLost) and each.cause == "refuted" for each in drive.events)
    assert drive.identified == TWIN


def test_a_refuted_car_is_not_believed_again_at_once() -> None:
    drive = Drive()
    drive.look(candidate(AHEAD, 0.98), seconds=5.0, answering={AHEAD: SPEED_M_S})
    drive.look(candidate(AHEAD, 0.98), seconds=3.0, ahead_m_s=13.0, answering={AHEAD: SPEED_M_S})
    drive.look(candidate(AHEAD, 0.98), seconds=1.0, answering={AHEAD: SPEED_M_S})
    assert drive.identified is None
    assert [type(each) for each in drive.events].count(Identified) == 1


def test_a_lead_missed_for_a_moment_keeps_the_evidence_of_its_motion() -> None:
    drive = Drive()
    for step in range(400):
        speed_m_s = SPEED_M_S + 2.0 * np.sin(step / 30.0)
        drive.look(ahead_m_s=speed_m_s, answering={AHEAD: speed_m_s, FAR: SPEED_M_S})
        if step % 9 == 0:
            drive.core.receive_lead(None, drive.now)
    drive.look(answering={})
    assert drive.identified == AHEAD


def test_leads_in_alternation_are_not_asked_for_at_every_image() -> None:
    drive = Drive()
    for step in range(100):
        drive.look(candidate((AHEAD, TWIN)[step % 2], 0.9), track_id=1 + step % 2)
    assert len(drive.inquiries) <= 100
    drive.now = 100.0
    for step in range(100):
        drive.look(candidate((AHEAD, TWIN)[step % 2], 0.9), track_id=1 + step % 2)
        drive.now -= 0.9 * FRAME_S  # 100 images a second
    assert len(drive.inquiries) <= 100 + 11


def test_answers_of_one_car_under_many_ids_are_bounded() -> None:
    drive = Drive()
    drive.look(candidate(AHEAD, 0.9))
    for number in range(100):
        sequence = drive.inquiries[-1].sequence
        answer = Answer(AHEAD, OWN, sequence, number.to_bytes(4), SPEED_M_S)
        drive.core.receive_message(answer, None, drive.now)
    assert drive.discarded() == ["too_many"] * 68


def test_hard_braking_does_not_refute_a_car_whose_bsms_are_late() -> None:
    drive = Drive()
    drive.look(candidate(AHEAD, 0.98), seconds=3.0, answering={AHEAD: SPEED_M_S})
    speeds = [max(2.0, SPEED_M_S - 0.7 * step) for step in range(60)]
    for step, speed_m_s in enumerate(speeds):
        drive.look(
            candidate(AHEAD, 0.98),
            ahead_m_s=speed_m_s,
            answering={AHEAD: speeds[max(0, step - 3)]},
        )
        assert drive.identified == AHEAD


def test_a_car_whose_plate_is_never_read_is_identified_by_its_motion() -> None:
    drive = Drive()
    for step in range(400):
        speed_m_s = SPEED_M_S + 2.0 * np.sin(step / 30.0)
        drive.look(ahead_m_s=speed_m_s, answering={AHEAD: speed_m_s, FAR: SPEED_M_S})
    assert drive.identified == AHEAD
    assert drive.inquiries[-1].names == (TEMPORARY[AHEAD],)
    assert any(isinstance(each, Identified) and each.cause == "motion" for each in drive.events)


def test_an_answer_under_another_id_disputes_no_car_that_its_motion_identified() -> None:
    """Of two that were asked by their motion, the other one, or an insider."""
    drive = Drive()
    for step in range(400):
        speed_m_s = SPEED_M_S + 2.0 * np.sin(step / 30.0)
        drive.look(ahead_m_s=speed_m_s, answering={AHEAD: speed_m_s})
    assert drive.identified == AHEAD
    drive.core.receive_speed_on_air(b"insider", TEMPORARY[TWIN], SPEED_M_S, drive.now)
    answer = Answer(TWIN, OWN, drive.inquiries[-1].sequence, TEMPORARY[TWIN], SPEED_M_S)
    drive.core.receive_message(answer, b"insider", drive.now)
    assert drive.core.sender == TEMPORARY[AHEAD]


@pytest.mark.parametrize("lag_s", [1.2, 1.6, 2.0, 3.0])
@pytest.mark.parametrize("period_s", [25.0, 40.0, 60.0])
def test_a_car_through_which_one_sees_no_plate_is_not_taken_for_the_one_ahead_of_it(
    period_s: float, lag_s: float
) -> None:
    """A motorcycle without radio follows a car on the air, some time behind."""
    drive, rng = Drive(), np.random.default_rng(2)
    for step in range(900):
        far_m_s, lead_m_s = (
            SPEED_M_S + 1.5 * np.sin(2.0 * np.pi * (FRAME_S * step - each_s) / period_s)
            for each_s in (0.0, lag_s)
        )
        sent_m_s = round(3.6 * far_m_s) / 3.6
        drive.look(ahead_m_s=lead_m_s + rng.normal(0.0, 0.3), answering={FAR: sent_m_s})
        assert drive.identified is None


def test_of_two_that_answer_the_one_whose_position_fits_is_ahead() -> None:
    drive = Drive()
    both = {AHEAD: SPEED_M_S, TWIN: SPEED_M_S}
    offsets_m = {TEMPORARY[AHEAD]: (29.0, 1.0, 2.0), TEMPORARY[TWIN]: (-150.0, 4.0, 2.0)}
    drive.core.receive_offsets(offsets_m)
    drive.look(candidate(AHEAD, 0.5), candidate(TWIN, 0.4), seconds=0.5, answering=both)
    assert drive.identified == AHEAD


def test_nothing_is_asked_far_ahead_at_a_standstill_and_for_the_own_plate() -> None:
    far = Drive()
    far.look(candidate(AHEAD, 0.9), seconds=2.0, gap_m=ASK_HEADWAY_S * SPEED_M_S)
    own = Drive()
    own.look(candidate(OWN, 0.9), seconds=2.0)
    still = Drive()
    still.core.receive_speed(0.0, 0.0)
    still.core.receive_lead(TrackedLead(0.0, 1, 5.0, 0.0, 0.3, (candidate(AHEAD, 0.9),)), 0.0)
    assert far.inquiries == own.inquiries == still.core.messages_to_send() == []


def test_an_inquiry_names_at_most_16_texts_and_none_twice() -> None:
    drive = Drive()
    cars = [f"{number % 20:04d}{number:04d}".encode() for number in range(40)]
    drive.look(*(candidate(car_id, 0.02) for car_id in cars))
    (inquiry,) = drive.inquiries
    assert len(inquiry.names) == len(set(inquiry.names)) == MAX_NAMES
    assert list(inquiry.names) == sorted(inquiry.names)  # a listener learns no order
    assert decode(encode(inquiry)).message == inquiry


def test_a_car_answers_for_its_plate_and_for_its_bsms_with_its_speed() -> None:
    drive = Drive()
    drive.core.receive_speed(12.0, 0.0)
    for now, name in ((0.0, OWN[:NAME_BYTES]), (1.0, TEMPORARY[OWN])):
        drive.core.receive_message(Inquiry(AHEAD, 7, (b"none", name)), None, now)
        speed_m_s = 12.0 if now < 1.0 else None
        assert drive.core.messages_to_send() == [Answer(OWN, AHEAD, 7, TEMPORARY[OWN], speed_m_s)]
    drive.core.receive_message(Inquiry(AHEAD, 8, (b"none",)), None, 2.0)
    assert drive.core.messages_to_send() == []


def test_inquiries_that_come_too_often_are_not_answered() -> None:
    drive = Drive()
    for step in range(100):
        drive.core.receive_message(Inquiry(AHEAD, step, (OWN[:NAME_BYTES],)), None, step * 0.01)
    assert len(drive.core.messages_to_send()) == ANSWERS_AT_ONCE + 1
    assert set(drive.discarded()) == {"too_often"}


def test_one_signer_is_answered_twice_a_second_under_however_many_ids() -> None:
    drive = Drive()
    for step in range(1000):
        inquiry = Inquiry(step.to_bytes(8), step, (OWN[:NAME_BYTES],))
        drive.core.receive_message(inquiry, b"signer 9", step * 0.01)
    assert len(drive.core.messages_to_send()) == ANSWERS_AT_ONCE + 19


def test_who_asks_too_often_leaves_others_their_answers() -> None:
    drive = Drive()
    for step in range(200):
        inquiry = Inquiry(step.to_bytes(8), step, (OWN[:NAME_BYTES],))
        drive.core.receive_message(inquiry, b"signer 9", step * 0.01)
    drive.core.messages_to_send()
    drive.core.receive_message(Inquiry(AHEAD, 7, (OWN[:NAME_BYTES],)), b"signer 1", 2.0)
    assert [a(Answer, each).to_id for each in drive.core.messages_to_send()] == [AHEAD]


def test_many_signers_together_are_answered_twenty_times_a_second() -> None:
    drive = Drive()
    for step in range(2000):
        inquiry = Inquiry(AHEAD, step, (OWN[:NAME_BYTES],))
        drive.core.receive_message(inquiry, step.to_bytes(8), step * 0.001)
    answers = drive.core.messages_to_send()
    assert len(answers) == ALL_ANSWERS_AT_ONCE + round(2.0 * ALL_ANSWERS_PER_S) - 1
    assert set(drive.discarded()) == {"too_often"}


def test_many_who_ask_as_often_as_they_may_leave_a_vehicle_behind_an_answer_a_second() -> None:
    drive = Drive()
    for step in range(600):
        now = step * 0.01
        for signer in range(19):
            inquiry = Inquiry(AHEAD, step, (OWN[:NAME_BYTES],))
            drive.core.receive_message(inquiry, signer.to_bytes(8), now)
        if step % 30 == 29:
            drive.core.receive_message(Inquiry(TWIN, step, (OWN[:NAME_BYTES],)), b"honest", now)
    answers = [a(Answer, each) for each in drive.core.messages_to_send()]
    to_honest = [each.sequence * 0.01 for each in answers if each.to_id == TWIN]
    assert to_honest[0] == pytest.approx(0.29)
    assert max(later - earlier for earlier, later in pairwise(to_honest)) < 1.25
    assert len(answers) <= 2 * (ALL_ANSWERS_AT_ONCE + 6.0 * ALL_ANSWERS_PER_S)


@pytest.mark.parametrize(
    ("ahead_m", "read", "by_bsms"),
    [(None, True, True), (-30.0, True, True), (40.0, True, False), (-250.0, False, False)],
)
def test_who_asks_by_bsms_may_be_behind_and_near_and_who_has_read_the_plate_near(
    ahead_m: float | None, read: bool, by_bsms: bool
) -> None:
    """An ID tells a participant which of the plates that it knows is there.

    Who sends no place may be behind all the same, without GNSS.
    """
    for name, is_answered in ((OWN[:NAME_BYTES], read), (TEMPORARY[OWN], by_bsms)):
        drive = Drive()
        drive.core.receive_speed_on_air(b"signer 9", b"asks", SPEED_M_S, 0.0)
        if ahead_m is not None:
            drive.core.receive_offsets({b"signer 9": (ahead_m, 3.0, 1.0)})
        drive.core.receive_message(Inquiry(AHEAD, 7, (name,)), b"signer 9", 0.0)
        assert bool(drive.core.messages_to_send()) is is_answered
        assert drive.discarded() == ([] if is_answered else ["not_behind"])


def test_what_was_not_asked_is_discarded() -> None:
    drive = Drive()
    drive.answer(Inquiry(OWN, 9, (AHEAD[:4],)), AHEAD)
    assert drive.discarded() == ["not_asked"]
    drive.look(candidate(AHEAD, 0.9))
    drive.answer(drive.inquiries[-1], TWIN)  # has a name that was not in the inquiry
    drive.core.receive_message(Answer(OWN, OWN, 1, TEMPORARY[OWN], 20.0), None, drive.now)
    assert drive.discarded() == ["not_asked", "not_asked", "own_echo"]
    assert drive.identified is None


def test_an_answer_after_the_lead_has_changed_identifies_nobody() -> None:
    drive = Drive()
    drive.look(candidate(AHEAD, 0.98))
    drive.look(candidate(TWIN, 0.98), track_id=2)
    drive.answer(drive.inquiries[0], AHEAD)
    assert drive.identified is None


def test_two_signers_that_answer_with_one_id_are_separated_by_their_speeds() -> None:
    drive = Drive()
    drive.look(candidate(AHEAD, 0.98))
    inquiry = drive.inquiries[-1]
    for signer, speed_m_s in ((b"honest", SPEED_M_S), (b"forger", SPEED_M_S - 8.0)):
        answer = Answer(AHEAD, OWN, inquiry.sequence, signer[:4], speed_m_s)
        drive.core.receive_message(answer, signer, drive.now)
    drive.look(candidate(AHEAD, 0.98))
    for _ in range(30):
        drive.core.receive_speed_on_air(b"honest", b"hone", SPEED_M_S, drive.now)
        drive.core.receive_speed_on_air(b"forger", b"forg", SPEED_M_S - 8.0, drive.now)
        drive.look(candidate(AHEAD, 0.98))
    assert drive.identified == AHEAD


def test_an_answer_under_the_id_of_the_last_epoch_is_discarded() -> None:
    drive = Drive()
    drive.look(candidate(AHEAD, 0.98))
    drive.core.set_own_id(b"own-1111", b"t-o1", drive.now)
    answer = Answer(AHEAD, b"own-1111", drive.inquiries[-1].sequence, TEMPORARY[AHEAD], SPEED_M_S)
    drive.core.receive_message(answer, None, drive.now)
    assert drive.discarded() == ["not_asked"]


def test_after_a_change_of_ids_an_identified_car_is_asked_again_for_its_bsms() -> None:
    drive = Drive()
    drive.look(candidate(AHEAD, 0.98), seconds=3.0, answering={AHEAD: SPEED_M_S})
    asked = len(drive.inquiries)
    drive.core.set_own_id(b"own-1111", b"t-o1", drive.now)
    renamed = CandidateCar("TEXTA", b"ahead-11", 0.98)
    drive.look(renamed, seconds=6.0)
    assert drive.core.identity is not None
    assert drive.core.identity.text == "TEXTA"
    assert len(drive.inquiries) > asked
    assert drive.inquiries[-1].names == (b"ahea",)


def test_without_signatures_a_lead_that_starts_again_is_known_by_its_new_bsms() -> None:
    """Its temporary ID is new, its communication ID and its motion are not."""
    drive = Drive()
    drive.look(candidate(AHEAD, 0.9995), seconds=1.0, answering={AHEAD: SPEED_M_S})
    assert drive.core.sender == TEMPORARY[AHEAD]
    drive.look(candidate(AHEAD, 0.9995), seconds=4.0)
    restarted = Answer(AHEAD, OWN, drive.inquiries[-1].sequence, b"new!", SPEED_M_S)
    drive.core.receive_message(restarted, None, drive.now)
    assert drive.core.sender == b"new!"


def test_a_neighbour_in_number_that_answers_is_not_believed_for_a_silent_likelier_text() -> None:
    """The lead may have no radio, and the one that answers be of the same fleet."""
    drive = Drive()
    silent = CandidateCar("GN418KB", FAR, 0.7)
    answered = CandidateCar("GN412KB", TWIN, 0.3)
    drive.look(silent, answered, seconds=3.0, answering={TWIN: SPEED_M_S})
    assert drive.identified is None
    other_fleet = CandidateCar("GM412KB", TWIN, 0.3)
    drive = Drive()
    drive.look(silent, other_fleet, seconds=3.0, answering={TWIN: SPEED_M_S})
    assert drive.identified == TWIN


def test_a_car_whose_first_answer_was_lost_is_still_the_lead() -> None:
    drive = Drive()
    texts = CandidateCar("GN418KB", AHEAD, 0.6), CandidateCar("GN412KB", TWIN, 0.4)
    drive.look(*texts, seconds=0.3, answering={TWIN: SPEED_M_S + 3.0})
    assert drive.identified is None
    drive.look(*texts, seconds=1.5, answering={TWIN: SPEED_M_S + 3.0, AHEAD: SPEED_M_S})
    assert drive.identified == AHEAD
