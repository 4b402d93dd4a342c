"""Charges of signers for alarms that nothing confirms."""

import math
from collections.abc import Collection

from onboard.misbehaviour.signer_credibility import (
    CAUTION_SHARE,
    CLAIM_S,
    HALF_LIFE_S,
    MOST_ALARMS,
    MOST_ALARMS_OF_UNIT,
    PASSING_ON,
    SLOWED_M_S,
    SignerCredibility,
)
from onboard.risk.alarm import RELEASE_S

LIAR, OTHER, UNIT = b"liar....", b"other...", b"unit...."
HOUR_S = 3600.0


class Host:
    """Asks at 10 Hz."""

    def __init__(self) -> None:
        self.credibility = SignerCredibility(lambda signer: signer == UNIT)
        self.now = 0.0

    def claim(
        self,
        name: str,
        *signers: bytes,
        for_s: float = 0.1,
        slows_traffic: bool = False,
        is_warning: bool = True,
        identified: Collection[bytes] = (),
    ) -> int:
        """Return at how many of the assessments the alarm is admitted."""
        admitted = 0
        for _ in range(round(for_s / 0.1)):
            self.now += 0.1
            admitted += self.credibility.admit(
                "ima",
                name,
                signers or (LIAR,),
                self.now,
                slows_traffic=slows_traffic,
                is_warning=is_warning,
                identified=identified,
            )
        return admitted

    def pause(self, duration_s: float) -> None:
        self.now += duration_s

    def traffic(self, *speeds_m_s: float) -> None:
        for speed_m_s in speeds_m_s:
            self.now += 0.1
            self.credibility.receive_traffic_speed(speed_m_s, self.now)


def test_the_fourth_unconfirmed_alarm_is_refused_for_an_hour() -> None:
    host = Host()
    assert [host.claim(name) for name in "abcd"] == [1, 1, 1, 0]
    host.pause(HOUR_S)
    assert host.claim("e") == 0


def test_a_road_side_unit_that_lies_is_ignored_later() -> None:
    host = Host()
    admitted = [host.claim(str(number), UNIT) for number in range(MOST_ALARMS_OF_UNIT + 3)]
    assert sum(admitted) == MOST_ALARMS_OF_UNIT
    assert admitted[-3:] == [0, 0, 0]


def test_charges_decay() -> None:
    host = Host()
    for name in "abc":
        host.claim(name)
    host.pause(HALF_LIFE_S)
    assert [host.claim(name) for name in "de"] == [1, 0]


def test_an_ignored_signer_is_reported_once_with_its_last_claim() -> None:
    host = Host()
    for name in "abcde":
        host.claim(name)
    event = host.credibility.next_event()
    assert event is not None
    assert (event.signer_id, event.vehicle) == (LIAR, "c")
    assert host.credibility.next_event() is None


def test_an_alarm_that_stays_on_is_charged_anew_after_its_time() -> None:
    host = Host()
    assert host.claim("a", for_s=60.0) <= MOST_ALARMS * CLAIM_S / 0.1 + MOST_ALARMS


def test_an_alarm_that_comes_again_is_a_new_one() -> None:
    host = Host()
    allowed = []
    for _ in range(5):
        allowed.append(host.claim("a"))
        host.pause(RELEASE_S)
    assert allowed == [1, 1, 1, 0, 0]


def test_the_third_alarm_goes_on_while_its_signer_is_ignored() -> None:
    host = Host()
    for name in "abc":
        assert host.claim(name, for_s=5.0) == 50
    assert host.credibility.is_ignored(LIAR, host.now)
    assert host.credibility.is_paid("c", host.now)
    assert not host.credibility.is_paid("a", host.now)


def test_what_own_sensors_measure_is_taken_back() -> None:
    host = Host()
    for number in range(20):
        assert host.claim(str(number)) == 1
        host.credibility.receive_sensed({str(number)}, host.now + 0.9 * CLAIM_S)


def test_what_is_seen_too_late_stays_charged() -> None:
    host = Host()
    for name in "abc":
        host.claim(name)
        host.pause(CLAIM_S)
        host.credibility.receive_sensed({name}, host.now)
    assert host.claim("d") == 0


def test_traffic_that_slows_down_confirms_a_braking_ahead() -> None:
    host = Host()
    for number in range(20):
        host.traffic(20.0, 20.0)
        assert host.claim(str(number), slows_traffic=True) == 1
        host.traffic(19.0, 18.0 - SLOWED_M_S)


def test_traffic_that_had_begun_to_slow_down_confirms_it_too() -> None:
    host = Host()
    for number in range(20):
        host.traffic(20.0, 19.0)
        assert host.claim(str(number), slows_traffic=True) == 1
        host.traffic(17.9)
        host.pause(CLAIM_S)


def test_steady_traffic_and_another_lead_confirm_nothing() -> None:
    host = Host()
    for name in "abc":
        host.traffic(20.0)
        host.claim(name, slows_traffic=True)
        host.traffic(19.0)
        host.credibility.receive_other_traffic()
        host.traffic(12.0)
    assert host.claim("d", slows_traffic=True) == 0


def test_traffic_that_varies_as_it_always_does_confirms_nothing() -> None:
    """By 1.5 m/s up and down in 12 s: three alarms, not three in every ten seconds."""
    host = Host()
    admitted = 0
    for number in range(10):
        admitted += host.claim(str(number), slows_traffic=True)
        began_s = host.now
        host.traffic(
            *(20.0 + 1.5 * math.sin((began_s + 0.1 * n) * math.tau / 12) for n in range(120))
        )
    assert admitted == MOST_ALARMS


def test_slow_traffic_does_not_confirm_a_vehicle_that_crosses() -> None:
    host = Host()
    for name in "abc":
        host.traffic(20.0)
        host.claim(name)
        host.traffic(10.0)
    assert host.claim("d") == 0


def test_several_signers_share_a_charge() -> None:
    host = Host()
    assert [host.claim(str(i), LIAR, OTHER) for i in range(8)] == [1] * 3 + [0] * 5


def test_of_several_signers_only_those_that_are_credible_pay() -> None:
    host = Host()
    for name in "abc":
        host.claim(name, is_warning=False)
    assert [host.claim(name, LIAR, OTHER) for name in "defg"] == [1, 1, 0, 0]


def test_memory_is_bounded() -> None:
    host = Host()
    for number in range(5000):
        host.claim(str(number), number.to_bytes(8))
    assert len(host.credibility._charges) <= 1024
    assert len(host.credibility._claims) <= 256


PSEUDONYMS = [bytes([number]) * 8 for number in range(20)]


def test_pseudonyms_by_turns_raise_as_many_false_alarms_as_one_signer() -> None:
    """Twenty pseudonyms of one enrolment raised twenty false alarms in two minutes."""
    host = Host()

    admitted = [host.claim(signer.hex(), signer) for signer in PSEUDONYMS]

    assert admitted == [1] * MOST_ALARMS + [0] * (20 - MOST_ALARMS)


def test_in_the_best_order_they_raise_twice_as_many_in_an_hour() -> None:
    """Three under the first, two under the second and one under the third."""
    host = Host()

    admitted = [host.claim(f"{n}{s.hex()}", s) for s in PSEUDONYMS for n in range(MOST_ALARMS)]

    assert sum(admitted) == 2 * MOST_ALARMS
    host.pause(HOUR_S)
    assert host.claim("later", PSEUDONYMS[9]) == 0


def test_one_insider_costs_the_others_no_alarm() -> None:
    host = Host()
    for name in "abc":
        host.claim(name)

    assert [host.claim(signer.hex(), signer) for signer in PSEUDONYMS[:2]] == [1, 1]


def test_who_lies_as_a_forwarder_is_ignored_as_a_forwarder_and_reported_by_its_certificate() -> (
    None
):
    host = Host()
    for name in "abc":
        host.claim(name, PASSING_ON + LIAR)

    assert host.credibility.is_ignored(PASSING_ON + LIAR, host.now)
    assert not host.credibility.is_ignored(LIAR, host.now)
    event = host.credibility.next_event()
    assert event is not None
    assert event.signer_id == LIAR


def test_all_who_pass_on_share_three_alarms_and_cost_other_signers_one_each() -> None:
    host = Host()

    passed_on = [host.claim(f"{n}{s.hex()}", PASSING_ON + s) for s in PSEUDONYMS for n in range(2)]

    assert sum(passed_on) == MOST_ALARMS
    assert host.claim("x", OTHER) == 1


def test_of_cautions_they_raise_more() -> None:
    """A caution counts a fifth against others, in the best order."""
    host = Host()

    admitted = [
        host.claim(f"{n}{s.hex()}", s, is_warning=False)
        for s in PSEUDONYMS
        for n in range(MOST_ALARMS)
    ]

    assert sum(admitted) == 11


def test_a_stranger_is_heard_again_when_the_charges_have_decayed() -> None:
    host = Host()
    for signer in PSEUDONYMS[:MOST_ALARMS]:
        host.claim(signer.hex(), signer)
    host.pause(70.0 * 60.0)
    assert host.claim("x", OTHER) == 0
    host.pause(60.0)

    assert host.claim("x", OTHER) == 1


def test_whoever_is_identified_is_heard_whatever_others_have_claimed() -> None:
    host = Host()
    for signer in PSEUDONYMS:
        host.claim(signer.hex(), signer)

    assert host.claim("x", OTHER) == 0
    assert [host.claim(name, OTHER, identified={OTHER}) for name in "abcd"] == [1, 1, 1, 0]


def test_traffic_that_slows_down_speaks_for_a_stranger() -> None:
    host = Host()
    for signer in PSEUDONYMS:
        host.claim(signer.hex(), signer)
    host.traffic(20.0, 20.0)
    assert host.claim("x", OTHER, slows_traffic=True) == 0

    host.traffic(20.0 - SLOWED_M_S)

    assert host.claim("x", OTHER) == 0
    assert host.claim("x", OTHER, slows_traffic=True) == 1
    assert not host.credibility.is_ignored(OTHER, host.now)


def test_cautions_of_many_signers_cost_others_little_until_they_become_warnings() -> None:
    host = Host()
    few = PSEUDONYMS[: round(2.0 / CAUTION_SHARE)]
    for signer in few:
        assert host.claim(signer.hex(), signer, is_warning=False) == 1
    assert host.claim("x", OTHER) == 1

    host = Host()
    for signer in few[:MOST_ALARMS]:
        host.claim(signer.hex(), signer, is_warning=False)
        host.claim(signer.hex(), signer)
    assert host.claim("x", OTHER) == 0


def test_a_unit_and_vehicles_share_no_allowance() -> None:
    host = Host()
    for signer in PSEUDONYMS:
        host.claim(signer.hex(), signer)
    assert host.claim("of the unit", UNIT) == 1

    host = Host()
    for number in range(MOST_ALARMS_OF_UNIT):
        host.claim(str(number), UNIT)
    assert host.claim("x", OTHER) == 1


def test_an_alarm_rises_to_a_warning_when_its_signer_is_no_longer_charged() -> None:
    """So many others have been charged meanwhile that it was dropped."""
    host = Host()
    host.claim("risen", LIAR, is_warning=False)
    others = [number.to_bytes(8, "big") for number in range(1024)]
    host.credibility.admit("ima", "other", others, host.now, slows_traffic=False, identified=others)

    assert host.claim("risen", LIAR) == 1
