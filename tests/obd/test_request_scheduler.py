"""When the car is asked for its speed, and when it is left in peace."""

import pytest

from onboard.obd.request_scheduler import Phase, Request, RequestScheduler
from onboard.obd.service_01 import CurrentData, Refused

SPEED = CurrentData({0x0D: b"\x32"})
BITMAP_WITH_SPEED = CurrentData({0x00: bytes.fromhex("BE3FA813")})
BITMAP_WITHOUT_SPEED = CurrentData({0x00: bytes.fromhex("80000000")})
ASK_BITMAP, ASK_SPEED = Request(0x00, is_extended_id=False), Request(0x0D, is_extended_id=False)
ASK_BITMAP_29, ASK_SPEED_29 = Request(0x00, is_extended_id=True), Request(0x0D, is_extended_id=True)


def new_tester(identifiers=(False, True)):
    return RequestScheduler(polling_hz=20, identifiers=identifiers)


def polling_tester(now=10.0):
    tester = new_tester()
    tester.requests_to_send(now)
    tester.receive_answer(SPEED, now, is_extended_id=False)
    assert tester.phase is Phase.POLLING
    return tester


def run(tester, start, end, answer=None):
    """Serve the timer from `start` to `end`; `answer` follows each request after 4 ms."""
    sent = []
    while (now := max(start, tester.get_timer())) < end:
        for request in tester.requests_to_send(now):
            sent.append((round(now, 3), request))
            if answer is not None:
                tester.receive_answer(answer, now + 0.004, is_extended_id=request.is_extended_id)
    return sent


def test_an_unknown_car_is_asked_by_turns_for_bitmap_and_speed_with_both_identifiers():
    assert run(new_tester(), 5.0, 6.2) == [
        (5.0, ASK_BITMAP),
        (5.25, ASK_SPEED),
        (5.5, ASK_BITMAP_29),
        (5.75, ASK_SPEED_29),
        (6.0, ASK_BITMAP),
    ]


def test_a_car_with_one_kind_of_identifier_is_asked_with_that_only():
    sent = run(new_tester(identifiers=(True,)), 5.0, 6.0)
    assert {request.is_extended_id for _, request in sent} == {True}


def test_a_silent_bus_is_not_flooded():
    assert len(run(new_tester(), 0.0, 60.0)) <= 240


def test_a_bitmap_that_promises_the_speed_is_followed_by_asking_for_it_after_p2():
    tester = new_tester()
    assert tester.requests_to_send(5.0) == [ASK_BITMAP]
    tester.receive_answer(BITMAP_WITH_SPEED, 5.004, is_extended_id=False)
    assert tester.phase is Phase.SEARCHING
    assert tester.get_timer() == pytest.approx(5.05)
    assert tester.requests_to_send(5.05) == [ASK_SPEED]


def test_a_bitmap_without_the_speed_speeds_nothing_up():
    tester = new_tester()
    tester.requests_to_send(5.0)
    tester.receive_answer(BITMAP_WITHOUT_SPEED, 5.004, is_extended_id=False)
    assert tester.get_timer() == pytest.approx(5.25)


def test_from_the_first_speed_on_the_car_is_polled_at_its_rate():
    tester = new_tester()
    sent = run(tester, 5.0, 6.0, answer=SPEED)
    assert tester.phase is Phase.POLLING
    assert sent[0] == (5.0, ASK_BITMAP)
    assert [at for at, _ in sent[1:4]] == [5.054, 5.104, 5.154]
    assert {request for _, request in sent[1:]} == {ASK_SPEED}
    assert 18 <= len(sent) <= 20


def test_polling_uses_the_identifiers_that_the_speed_came_with():
    tester = new_tester()
    tester.requests_to_send(5.0)
    tester.receive_answer(SPEED, 5.1, is_extended_id=True)
    assert run(tester, 5.1, 5.16) == [(5.15, ASK_SPEED_29)]


def test_a_speed_that_another_tester_asked_for_counts_too():
    tester = new_tester()
    tester.receive_answer(SPEED, 5.0, is_extended_id=False)
    assert tester.phase is Phase.POLLING


def test_an_ecu_that_falls_silent_is_searched_for_again_after_a_second():
    tester = polling_tester(10.0)
    sent = run(tester, 10.0, 13.0)
    assert tester.phase is Phase.SEARCHING
    polled = [at for at, _ in sent if at < 11.0]
    searched = [at for at, _ in sent if at >= 11.0]
    assert len(polled) == 19
    assert len(searched) <= 9


def test_an_ecu_that_only_refuses_is_not_polled():
    tester = new_tester()
    run(tester, 0.0, 10.0, answer=Refused(0x12))
    assert tester.phase is Phase.SEARCHING
    tester = polling_tester(10.0)
    run(tester, 10.0, 12.0, answer=Refused(0x22))
    assert tester.phase is Phase.SEARCHING


def test_an_ecu_that_comes_back_is_polled_again_within_a_search_round():
    tester = polling_tester(10.0)
    run(tester, 10.0, 20.0)
    run(tester, 20.0, 21.1, answer=SPEED)
    assert tester.phase is Phase.POLLING


def test_response_pending_holds_the_next_request_back():
    tester = polling_tester(10.0)
    assert tester.requests_to_send(10.05) == [ASK_SPEED]
    tester.receive_answer(Refused(0x78), 10.06, is_extended_id=False)
    assert tester.get_timer() == pytest.approx(15.06)
    assert tester.requests_to_send(10.10) == []


def test_the_answer_after_response_pending_lets_polling_go_on():
    tester = polling_tester(10.0)
    tester.requests_to_send(10.05)
    tester.receive_answer(Refused(0x78), 10.06, is_extended_id=False)
    tester.receive_answer(SPEED, 10.5, is_extended_id=False)
    assert tester.requests_to_send(10.5) == [ASK_SPEED]
    assert tester.phase is Phase.POLLING


def test_a_refusal_after_response_pending_lets_polling_go_on():
    tester = polling_tester(10.0)
    tester.requests_to_send(10.05)
    tester.receive_answer(Refused(0x78), 10.06, is_extended_id=False)
    tester.receive_answer(Refused(0x22), 10.2, is_extended_id=False)
    assert tester.requests_to_send(10.2) == [ASK_SPEED]
    assert tester.phase is Phase.POLLING


def test_pending_without_an_answer_ends_in_searching():
    tester = polling_tester(10.0)
    tester.requests_to_send(10.05)
    tester.receive_answer(Refused(0x78), 10.06, is_extended_id=False)
    run(tester, 10.06, 15.5)
    assert tester.phase is Phase.SEARCHING


def test_response_pending_to_nobody_changes_nothing():
    tester = polling_tester(10.0)
    tester.requests_to_send(10.05)
    tester.receive_answer(SPEED, 10.055, is_extended_id=False)
    tester.receive_answer(Refused(0x78), 10.06, is_extended_id=False)
    assert tester.get_timer() == pytest.approx(10.1)


def test_the_open_request_is_the_one_not_yet_answered():
    tester = polling_tester(10.0)
    tester.requests_to_send(10.05)
    assert tester.open_request == ASK_SPEED
    tester.receive_answer(CurrentData({0x0C: b"\x00\x00"}), 10.055, is_extended_id=False)
    assert tester.open_request == ASK_SPEED
    tester.receive_answer(SPEED, 10.056, is_extended_id=False)
    assert tester.open_request is None


def test_after_a_pause_of_the_car_requests_do_not_pile_up():
    tester = polling_tester(10.0)
    tester.receive_answer(SPEED, 12.0, is_extended_id=False)
    assert tester.requests_to_send(12.0) == [ASK_SPEED]
    assert tester.requests_to_send(12.01) == []


def test_while_a_better_source_is_there_nothing_is_asked():
    tester = polling_tester(10.0)
    tester.rest_until(10.5)
    assert tester.requests_to_send(10.4) == []
    assert tester.get_timer() == 10.5
    assert len(tester.requests_to_send(10.5)) == 1
