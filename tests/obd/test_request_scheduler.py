"""Requests of the speed, their timeouts, and pauses."""

import pytest

from onboard.obd.request_scheduler import Phase, Request, RequestScheduler
from onboard.obd.service_01 import NegativeResponse, PositiveResponse

SPEED = PositiveResponse({0x0D: b"\x32"})
BITMAP_WITH_SPEED = PositiveResponse({0x00: bytes.fromhex("BE3FA813")})
BITMAP_WITHOUT_SPEED = PositiveResponse({0x00: bytes.fromhex("80000000")})
ASK_BITMAP, ASK_SPEED = Request(0x00, is_extended_id=False), Request(0x0D, is_extended_id=False)
ASK_BITMAP_29, ASK_SPEED_29 = Request(0x00, is_extended_id=True), Request(0x0D, is_extended_id=True)


def new_tester(identifiers: tuple[bool, ...] = (False, True)) -> RequestScheduler:
    return RequestScheduler(polling_hz=20, identifiers=identifiers)


def polling_tester(now: float = 10.0) -> RequestScheduler:
    scheduler = new_tester()
    scheduler.requests_to_send(now)
    scheduler.receive_response(SPEED, now, is_extended_id=False)
    assert scheduler.phase is Phase.POLLING
    return scheduler


def run(
    scheduler: RequestScheduler,
    start: float,
    end: float,
    answer: NegativeResponse | PositiveResponse | None = None,
) -> list[tuple[float, Request]]:
    """Serve the timer from `start` to `end`; `answer` follows each request after 4 ms."""
    sent = []
    while (now := max(start, scheduler.get_timer())) < end:
        for request in scheduler.requests_to_send(now):
            sent.append((round(now, 3), request))
            if answer is not None:
                scheduler.receive_response(
                    answer, now + 0.004, is_extended_id=request.is_extended_id
                )
    return sent


def test_searching_alternates_bitmap_and_speed_with_both_identifiers() -> None:
    assert run(new_tester(), 5.0, 6.2) == [
        (5.0, ASK_BITMAP),
        (5.25, ASK_SPEED),
        (5.5, ASK_BITMAP_29),
        (5.75, ASK_SPEED_29),
        (6.0, ASK_BITMAP),
    ]


def test_searching_uses_only_the_configured_identifiers() -> None:
    sent = run(new_tester(identifiers=(True,)), 5.0, 6.0)
    assert {request.is_extended_id for _, request in sent} == {True}


def test_a_silent_bus_is_not_flooded() -> None:
    assert len(run(new_tester(), 0.0, 60.0)) <= 240


def test_after_a_bitmap_with_the_speed_it_is_requested_after_p2() -> None:
    scheduler = new_tester()
    assert scheduler.requests_to_send(5.0) == [ASK_BITMAP]
    scheduler.receive_response(BITMAP_WITH_SPEED, 5.004, is_extended_id=False)
    assert scheduler.phase is Phase.SEARCHING
    assert scheduler.get_timer() == pytest.approx(5.05)
    assert scheduler.requests_to_send(5.05) == [ASK_SPEED]


def test_a_bitmap_without_the_speed_changes_nothing() -> None:
    scheduler = new_tester()
    scheduler.requests_to_send(5.0)
    scheduler.receive_response(BITMAP_WITHOUT_SPEED, 5.004, is_extended_id=False)
    assert scheduler.get_timer() == pytest.approx(5.25)


def test_from_the_first_speed_on_it_is_polled_at_the_configured_rate() -> None:
    scheduler = new_tester()
    sent = run(scheduler, 5.0, 6.0, answer=SPEED)
    assert scheduler.phase is Phase.POLLING
    assert sent[0] == (5.0, ASK_BITMAP)
    assert [at for at, _ in sent[1:4]] == [5.054, 5.104, 5.154]
    assert {request for _, request in sent[1:]} == {ASK_SPEED}
    assert 18 <= len(sent) <= 20


def test_polling_uses_the_identifiers_that_the_speed_came_with() -> None:
    scheduler = new_tester()
    scheduler.requests_to_send(5.0)
    scheduler.receive_response(SPEED, 5.1, is_extended_id=True)
    assert run(scheduler, 5.1, 5.16) == [(5.15, ASK_SPEED_29)]


def test_a_speed_requested_by_another_tester_counts() -> None:
    scheduler = new_tester()
    scheduler.receive_response(SPEED, 5.0, is_extended_id=False)
    assert scheduler.phase is Phase.POLLING


def test_after_a_second_of_unanswered_requests_it_searches_again() -> None:
    scheduler = polling_tester(10.0)
    sent = run(scheduler, 10.0, 13.0)
    assert scheduler.phase is Phase.SEARCHING
    polled = [at for at, _ in sent if at < 11.0]
    searched = [at for at, _ in sent if at >= 11.0]
    assert len(polled) == 19
    assert len(searched) <= 9


def test_negative_responses_do_not_start_polling() -> None:
    scheduler = new_tester()
    run(scheduler, 0.0, 10.0, answer=NegativeResponse(0x12))
    assert scheduler.phase is Phase.SEARCHING
    scheduler = polling_tester(10.0)
    run(scheduler, 10.0, 12.0, answer=NegativeResponse(0x22))
    assert scheduler.phase is Phase.SEARCHING


def test_an_ecu_that_responds_again_is_polled_within_a_search() -> None:
    scheduler = polling_tester(10.0)
    run(scheduler, 10.0, 20.0)
    run(scheduler, 20.0, 21.1, answer=SPEED)
    assert scheduler.phase is Phase.POLLING


def test_response_pending_delays_the_next_request() -> None:
    scheduler = polling_tester(10.0)
    assert scheduler.requests_to_send(10.05) == [ASK_SPEED]
    scheduler.receive_response(NegativeResponse(0x78), 10.06, is_extended_id=False)
    assert scheduler.get_timer() == pytest.approx(15.06)
    assert scheduler.requests_to_send(10.10) == []


def test_polling_continues_with_the_response_after_response_pending() -> None:
    scheduler = polling_tester(10.0)
    scheduler.requests_to_send(10.05)
    scheduler.receive_response(NegativeResponse(0x78), 10.06, is_extended_id=False)
    scheduler.receive_response(SPEED, 10.5, is_extended_id=False)
    assert scheduler.requests_to_send(10.5) == [ASK_SPEED]
    assert scheduler.phase is Phase.POLLING


def test_polling_continues_with_a_negative_response_after_response_pending() -> None:
    scheduler = polling_tester(10.0)
    scheduler.requests_to_send(10.05)
    scheduler.receive_response(NegativeResponse(0x78), 10.06, is_extended_id=False)
    scheduler.receive_response(NegativeResponse(0x22), 10.2, is_extended_id=False)
    assert scheduler.requests_to_send(10.2) == [ASK_SPEED]
    assert scheduler.phase is Phase.POLLING


def test_an_unanswered_request_after_response_pending_ends_in_searching() -> None:
    scheduler = polling_tester(10.0)
    scheduler.requests_to_send(10.05)
    scheduler.receive_response(NegativeResponse(0x78), 10.06, is_extended_id=False)
    run(scheduler, 10.06, 15.5)
    assert scheduler.phase is Phase.SEARCHING


def test_response_pending_without_a_request_changes_nothing() -> None:
    scheduler = polling_tester(10.0)
    scheduler.requests_to_send(10.05)
    scheduler.receive_response(SPEED, 10.055, is_extended_id=False)
    scheduler.receive_response(NegativeResponse(0x78), 10.06, is_extended_id=False)
    assert scheduler.get_timer() == pytest.approx(10.1)


def test_a_request_is_unanswered_until_its_response() -> None:
    scheduler = polling_tester(10.0)
    scheduler.requests_to_send(10.05)
    assert scheduler.unanswered_request == ASK_SPEED
    scheduler.receive_response(PositiveResponse({0x0C: b"\x00\x00"}), 10.055, is_extended_id=False)
    assert scheduler.unanswered_request == ASK_SPEED
    scheduler.receive_response(SPEED, 10.056, is_extended_id=False)
    assert scheduler.unanswered_request is None


def test_requests_do_not_pile_up_after_a_pause() -> None:
    scheduler = polling_tester(10.0)
    scheduler.receive_response(SPEED, 12.0, is_extended_id=False)
    assert scheduler.requests_to_send(12.0) == [ASK_SPEED]
    assert scheduler.requests_to_send(12.01) == []


def test_no_request_is_sent_while_there_is_a_better_source() -> None:
    scheduler = polling_tester(10.0)
    scheduler.pause_until(10.5)
    assert scheduler.requests_to_send(10.4) == []
    assert scheduler.get_timer() == 10.5
    assert len(scheduler.requests_to_send(10.5)) == 1
