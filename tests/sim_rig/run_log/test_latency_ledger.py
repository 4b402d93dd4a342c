"""The ledger takes each delay from the stamps of the right two records."""

import pytest

from sim_rig.run_log.latency_ledger import ledger
from sim_rig.run_log.run_log import RunLog

GREEN, RED, BLUE = "aa", "bb", "cc"


def warn(sender: str, hops: int) -> dict[str, object]:
    return {"sender_id": sender, "event_origin_id": GREEN, "event_sequence": 7, "hops": hops}


def answer(stamp_s: float, speed_km_h: int) -> dict[str, object]:
    return {"stamp_s": stamp_s, "kind": "ecu_answer", "car": "green", "speed_km_h": speed_km_h}


def a_braking_over_two_hops() -> RunLog:
    """Green brakes at 1.0 s and is certain at 1.30 s; red hears green, blue hears red."""
    speeds = [(0.9, 50), (1.0, 50), (1.1, 49), (1.2, 49), (1.25, 47), (1.3, 45)]
    alarm = {"kind": "warning", "origin_id": GREEN, "sequence": 7}
    heard = {"kind": "received", "message": "warn"}
    sent = {"kind": "sent", "message": "warn"}
    return RunLog(
        start_s=0.0,
        traces={
            "green": [
                {"stamp_s": 1.302, "kind": "hard_brake", "is_over": False},
                sent | {"stamp_s": 1.303, "content": warn(GREEN, 1)},
            ],
            "red": [
                heard | {"stamp_s": 1.308, "content": warn(GREEN, 1)},
                alarm | {"stamp_s": 1.309},
                sent | {"stamp_s": 1.310, "content": warn(RED, 2)},
            ],
            "blue": [
                heard | {"stamp_s": 1.320, "content": warn(RED, 2)},
                alarm | {"stamp_s": 1.320},
                heard | {"stamp_s": 1.400, "content": warn(RED, 2)},
            ],
        },
        rig=[answer(*speed) for speed in speeds],
        names={GREEN: "green", RED: "red", BLUE: "blue"},
    )


def test_each_hop_of_two_warnings() -> None:
    lines = {line.hop: line for line in ledger(a_braking_over_two_hops())}

    assert {hop: line.n for hop, line in lines.items()} == {
        "noticed": 1,
        "detected": 1,
        "sent": 1,
        "received": 2,
        "alarm": 2,
        "chain": 2,
    }
    # Quantiles of two samples lie between them: numpy's definition 7.
    expected = {
        "noticed": (0.2, 0.2),
        "detected": (0.002, 0.002),
        "sent": (0.001, 0.001),
        "received": (0.0075, 0.00995),
        "alarm": (0.0005, 0.00099),
        "chain": (0.0125, 0.01789),
    }
    for hop, (p50_s, p99_s) in expected.items():
        assert (lines[hop].p50_s, lines[hop].p99_s) == pytest.approx((p50_s, p99_s)), hop


def test_a_run_without_braking_has_an_empty_ledger() -> None:
    assert ledger(RunLog(0.0, {"green": []}, [], {})) == []
