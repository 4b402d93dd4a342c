"""The own clock is wrong if several others have another time, and nobody has the own one."""

import pytest

from onboard.security.clock_check import MAX_SIGNERS, RECEIVED_S, ClockCheck

ANN, BEN, EVA = (bytes([number] * 8) for number in range(3))


def heard(*errors_s: tuple[bytes, float], now: float = 5.0) -> ClockCheck:
    check = ClockCheck()
    for signer, error_s in errors_s:
        check.receive_error(signer, error_s, now)
    return check


@pytest.mark.parametrize("error_s", [600.0, -600.0])
def test_two_others_that_agree_show_by_how_much_it_is_wrong(error_s: float) -> None:
    check = heard((ANN, error_s - 0.5), (BEN, error_s + 0.5))

    assert check.error_s(5.0) == pytest.approx(error_s)
    assert check.is_wrong


@pytest.mark.parametrize(
    "errors_s",
    [
        [(ANN, 600.0)],
        [(ANN, 600.0), (ANN, 600.1)],
        [(ANN, 600.0), (BEN, -30.0)],
        [(EVA, 7.0), (b"4" * 8, 20.0), (ANN, 600.0), (BEN, 600.0)],
    ],
)
def test_one_other_or_others_that_differ_show_nothing(errors_s: list[tuple[bytes, float]]) -> None:
    check = heard(*errors_s)

    assert check.error_s(5.0) is None
    assert not check.is_wrong


def test_a_verified_message_that_agrees_outweighs_any_number_that_do_not() -> None:
    check = ClockCheck()
    check.receive_agreement(0.0)
    for number in range(20):
        check.receive_error(bytes([number] * 8), 600.0, RECEIVED_S - 1.0)
    assert not check.is_wrong

    check.receive_error(ANN, 600.0, RECEIVED_S + 1.0)
    assert check.is_wrong
    check.receive_agreement(RECEIVED_S + 2.0)
    assert not check.is_wrong


def test_it_stays_wrong_while_nobody_is_heard() -> None:
    check = heard((ANN, 600.0), (BEN, 600.0))

    check.receive_error(EVA, 600.0, 5.0 + 2 * RECEIVED_S)

    assert check.error_s(5.0 + 2 * RECEIVED_S) is None
    assert check.is_wrong


def test_a_flood_of_made_up_signers_is_bounded() -> None:
    check = ClockCheck()
    for number in range(3 * MAX_SIGNERS):
        check.receive_error(number.to_bytes(8), float(100 * number), 0.0)

    assert check.error_s(0.0) is None
