"""DCC: the states, the equilibrium of the adaptive approach, and a gate that keeps to the rate."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.its_g5.congestion_control import (
    BURST_FRAMES,
    BURST_PERIOD_S,
    CongestionControl,
)
from onboard.its_g5.dcc_rate import (
    ALPHA,
    BETA,
    LONG_FRAME_S,
    LONG_FRAMES,
    SHORT_FRAME_S,
    SHORT_FRAMES,
    TARGET_LOAD,
    AdaptiveRate,
    DccState,
    ReactiveRate,
    StateMachine,
)
from onboard.observations import Discarded
from onboard.settings import SettingsError, parse_settings
from onboard.vehicle.config import CarConfig
from onboard.wave_udp.radio_queue import RadioQueue, airtime_s
from onboard.wave_udp.settings import CongestionControlApproach
from tests.typed import a

REACTIVE, ADAPTIVE = CongestionControlApproach
CAM_PRIORITY, DENM_PRIORITY = 3, 7
CAM_BYTES = 300
"""On the air for 0.48 ms."""


def test_the_state_moves_to_a_neighbour_at_a_time() -> None:
    machine = StateMachine()
    states = []
    for load in (0.7, 0.7, 0.7, 0.7, 0.7, 0.35, 0.35, 0.35, 0.35):
        machine.receive_load(load)
        states.append(machine.state.value)
    assert states == [
        "active_1", "active_2", "active_3", "restrictive", "restrictive", "active_3", "active_2",
        "active_1", "active_1",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("load", "short_s", "long_s"),
    [(0.29, 0.05, 0.1), (0.3, 0.1, 0.2), (0.49, 0.2, 0.4), (0.59, 0.25, 0.5), (0.65, 1.0, 1.0)],
)
def test_the_reactive_interval_is_that_of_annex_a(
    load: float, short_s: float, long_s: float
) -> None:
    rate = ReactiveRate()
    for _ in range(5):
        rate.receive_load(load)
    assert rate.interval_s(SHORT_FRAME_S) == short_s
    assert rate.interval_s(LONG_FRAME_S) == long_s
    assert rate.interval_s(2 * LONG_FRAME_S) == min(2 * long_s, 1.0)


@pytest.mark.parametrize("stations", [30, 120])
def test_adaptive_stations_converge_to_the_published_equilibrium(stations: int) -> None:
    """Bansal, Kenney and Rohrs 2013: each has beta target / (alpha + K beta), however it began."""
    rng = np.random.default_rng(stations)
    rates = [AdaptiveRate() for _ in range(stations)]
    for rate, start in zip(rates, rng.uniform(0.0006, 0.03, stations), strict=True):
        rate.duty_cycle = start
    for _ in range(800):  # 80 s
        load = min(sum(rate.duty_cycle for rate in rates), 1.0)
        for rate in rates:
            rate.receive_load(load)
    equilibrium = BETA * TARGET_LOAD / (ALPHA + stations * BETA)
    assert [rate.duty_cycle for rate in rates] == pytest.approx([equilibrium] * stations, rel=0.02)


def test_stations_that_always_send_load_the_channel_as_the_equilibrium_says() -> None:
    """With own gates and measurements: nothing but frames goes from one to the other."""
    stations, size_bytes = 20, 600
    controls = [CongestionControl(ADAPTIVE, 0.0) for _ in range(stations)]
    sent = 0
    for now in np.arange(0.0, 25.0, 0.005):
        for control in controls:
            control.handle_timer(now)
        for sender in controls:
            if (at := sender.opens_at(CAM_PRIORITY)) > now:
                continue
            sender.receive_sent(size_bytes, CAM_PRIORITY, max(at, now - 0.005))
            sent += int(now >= 20.0)
            for other in controls:
                if other is not sender:
                    other.receive_frame(size_bytes)
    expected = stations * BETA * TARGET_LOAD / (ALPHA + stations * BETA)
    assert sent * airtime_s(size_bytes) / 5.0 == pytest.approx(expected, rel=0.05)


loads = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=60)
offered = st.lists(
    st.tuples(st.integers(0, 5), st.integers(50, 1400), st.floats(0.0, 0.1)), max_size=60
)


@given(loads, offered, st.sampled_from([REACTIVE, ADAPTIVE]))
def test_no_frame_is_sent_sooner_than_the_rate_allows(
    loads: list[float],
    offered: list[tuple[int, int, float]],
    approach: CongestionControlApproach,
) -> None:
    """Never sooner than the shortest interval that was allowed since the frame before."""
    control = CongestionControl(approach, 0.0)
    queue = RadioQueue(gate=control)
    reference = ReactiveRate() if approach is REACTIVE else AdaptiveRate()
    now, sent = 0.0, list[tuple[float, float]]()
    shortest_s: list[float] = []
    waiting = list(offered)
    put_at = 0.0
    for load in loads:
        until = control.get_timer()
        while True:
            while waiting and put_at <= now:
                priority, size, later_s = waiting.pop()
                queue.put(bytes(size), priority, now + 1e9, now)
                put_at = now + later_s
            for _, wsm in queue.wsms_to_send(now):
                sent.append((now, airtime_s(len(wsm))))
                shortest_s.append(reference.interval_s(sent[-1][1]))
            now = max(min(queue.get_timer(), put_at if waiting else until, until), now)
            if now >= until:
                break
        control.receive_frame(round(load * 0.1 / (8e-6 / 6.0)))  # fills this share, about
        busy = control._busy_s
        control.handle_timer(until)
        reference.receive_load(min(busy / 0.1, 1.0))
        if sent:
            shortest_s[-1] = min(shortest_s[-1], reference.interval_s(sent[-1][1]))
    for ((before, _), (after, _)), least_s in zip(pairwise(sent), shortest_s, strict=False):
        assert after - before >= least_s - 1e-9
        assert after - before >= 0.025 - 1e-9


def test_urgent_frames_pass_a_closed_gate_up_to_a_burst_and_close_it_for_others() -> None:
    control = CongestionControl(REACTIVE, 0.0)
    queue = RadioQueue(gate=control)
    sent = list[float]()
    for now in np.arange(0.0, 5.0, 0.01):
        queue.put(b"cam", CAM_PRIORITY, now + 0.1, now)
        queue.put(b"denm", DENM_PRIORITY, now + 0.1, now)
        sent += [now for priority, _ in queue.wsms_to_send(now) if priority == DENM_PRIORITY]
    # The first finds the gate open; after the burst it opens 20 times a second.
    assert sent[BURST_FRAMES] == pytest.approx(0.2)
    assert np.diff(sent[BURST_FRAMES + 1 :]) == pytest.approx(0.05, abs=0.0101)
    assert control.opens_at(DENM_PRIORITY) <= BURST_PERIOD_S
    assert {a(Discarded, event).reason for event in iter(queue.next_event, None)} == {"expired"}


def test_a_busier_channel_moves_the_opening_by_the_share_that_is_left() -> None:
    """Equation B.2."""
    control = CongestionControl(REACTIVE, 0.0)
    for _ in range(4):
        control.receive_frame(60_000)
        control.handle_timer(control.get_timer())
    sent_s = 0.4
    control.receive_sent(CAM_BYTES, CAM_PRIORITY, sent_s)  # restrictive
    assert control.opens_at(CAM_PRIORITY) == pytest.approx(sent_s + 1.0)
    control.handle_timer(control.get_timer())  # nothing received: active 3
    assert control.opens_at(CAM_PRIORITY) == pytest.approx(sent_s + 0.1 + 0.9 * 0.25)


def test_a_change_of_state_is_put_out() -> None:
    control = CongestionControl(ADAPTIVE, 0.0)
    control.receive_frame(30_000)
    control.handle_timer(0.1)
    event = control.next_event()
    assert event is not None
    assert event.state is DccState.ACTIVE_1
    assert event.channel_busy_ratio == pytest.approx(0.4, abs=0.01)
    assert control.next_event() is None


def test_the_tables_have_a_row_for_each_state() -> None:
    assert len(SHORT_FRAMES) == len(LONG_FRAMES) == len(DccState)


def test_wave_takes_no_approach() -> None:
    tree = {
        "car": {"plate": "AAA1"},
        "radio": {"endpoint": "raw", "interface": "air", "congestion_control": "reactive"},
    }
    with pytest.raises(SettingsError, match="profile its-g5"):
        parse_settings(tree, CarConfig, "car.yaml")
