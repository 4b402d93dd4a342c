"""Validation of the 802.11p channel against ns-3: cars in a line that all broadcast.

Delivery ratio and delay by distance, in the columns of the ns-3 reference for the same settings.
All parameters are those of the reference, including two peculiarities of ns-3: symbols of 4 us, and
thresholds that are 3 dB lower in a 10 MHz channel.
"""

import heapq
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from onboard.errors import UserError
from onboard.settings import Settings
from sim_rig.propagation.path_loss import DualSlope, LogDistance, PathLoss, TwoRay
from sim_rig.radio.broadcast_channel import broadcast_channel
from sim_rig.radio.channel import Channel, Reception
from sim_rig.radio.sidelink import SidelinkChannel
from sim_rig.scenario.radio_settings import ChannelSettings, CsmaSettings, SidelinkSettings
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

BIN_M = 50.0
_LOSSES: dict[str, type[LogDistance | DualSlope | TwoRay]] = {
    "log-distance": LogDistance,
    "dual-slope": DualSlope,
    "two-ray": TwoRay,
}
_ORDERS = {
    "log-distance": ("exponent", "reference_db"),
    "dual-slope": ("near_exponent", "far_exponent", "breakpoint_m", "reference_db"),
    "two-ray": ("antenna_height_m", "frequency_ghz"),
}
"""Settings that the numbers after a model's name stand for."""


def parse_loss(text: str) -> PathLoss:
    """Parse `MODEL` or `MODEL:NUMBER:...`, the numbers in the order of the model's settings.

    Raises:
        ValueError: there is no such model, or its numbers do not fit.
    """
    name, *numbers = text.split(":")
    if name not in _LOSSES:
        raise ValueError(f"no such path loss {name!r}; there are: {', '.join(_LOSSES)}")
    fields = _ORDERS[name]
    if len(numbers) > len(fields):
        raise ValueError(f"{name} takes at most {len(fields)} numbers: {', '.join(fields)}")
    values = {field: float(number) for field, number in zip(fields, numbers, strict=False)}
    return _LOSSES[name].model_validate(values)


def parse_fading(text: str) -> float | None:
    """Parse `none`, `nakagami:M` or `rayleigh`; returns m of Nakagami, None without fading.

    Raises:
        ValueError: `text` is none of these.
    """
    name, _, number = text.partition(":")
    if text == "none":
        return None
    if text == "rayleigh":
        return 1.0
    if name == "nakagami" and number and 0.5 <= float(number) <= 50.0:
        return float(number)
    raise ValueError("must be none, rayleigh or nakagami:M, M from 0.5 to 50")


def _checked_loss(text: str) -> str:
    parse_loss(text)
    return text


def _checked_fading(text: str) -> str:
    parse_fading(text)
    return text


class RadioSettings(Settings):
    """Road, channel and messages."""

    model: Literal["csma", "sidelink"] = "csma"
    """802.11p, or C-V2X in mode 4; below, what is of 802.11p only has no effect on C-V2X."""
    cars: int = Field(100, ge=2, le=2_000)
    """Number of cars in a line."""
    spacing_m: float = Field(10.0, gt=0.0, le=1_000.0)
    """Between two cars."""
    loss: Annotated[str, AfterValidator(_checked_loss)] = "dual-slope"
    """`log-distance[:EXPONENT[:DB_AT_1_M]]`, `dual-slope[:NEAR[:FAR[:BREAK_M[:DB_AT_1_M]]]]` or
    `two-ray[:ANTENNA_M[:GHZ]]`."""
    fading: Annotated[str, AfterValidator(_checked_fading)] = "none"
    """`none`, `rayleigh` or `nakagami:M`."""
    seeds: int = Field(20, ge=1)
    """Number of runs, each with the next seed."""
    seed: int = Field(1, ge=0)
    """The first seed."""
    seconds: float = Field(4.8, gt=0.0, le=600.0)
    """Duration of each run, including the warm-up."""
    warm_s: float = Field(1.0, ge=0.0, le=60.0)
    """Frames queued before this time are not counted."""
    interval_s: float = Field(0.1, gt=0.0, le=10.0)
    """Between two frames of a car, without the jitter."""
    jitter_s: float = Field(0.001, ge=0.0, le=10.0)
    """Added to each interval, uniform from 0 to this."""
    payload_bytes: int = Field(250, ge=1, le=2_000)
    """Length of a message without the headers of the channel."""
    user_priority: int = Field(5, ge=0, le=7)
    """5 belongs to AC_VI, 7 to AC_VO."""
    data_rate_mbit_s: Literal[3, 6, 9, 12, 18, 24, 27] = 6
    """Of all frames, in a 10 MHz channel."""
    tx_power_dbm: float = Field(20.0, ge=-10.0, le=40.0)
    """Transmit power at the antenna."""
    noise_figure_db: float = Field(7.0, ge=0.0, le=30.0)
    """Noise that the receiver adds to the thermal noise."""
    preamble_snr_db: float = Field(4.0, ge=-10.0, le=30.0)
    """Least SINR at which a preamble is detected."""
    preamble_dbm: float = Field(-95.0, ge=-120.0, le=0.0)
    """Least received power at which a preamble is detected."""
    sensitivity_dbm: float = Field(-104.0, ge=-140.0, le=0.0)
    """ns-3 halves the -101 dBm of 20 MHz for a 10 MHz channel."""
    energy_detection_dbm: float = Field(-88.0, ge=-120.0, le=0.0)
    """ns-3 halves the -85 dBm of 20 MHz for a 10 MHz channel."""
    symbol_us: Literal[4, 8] = 4
    """ns-3 rounds frames to 4 us; the standard specifies 8 us in 10 MHz."""

    @property
    def channel(self) -> ChannelSettings:
        """Settings of the channel."""
        if self.model == "sidelink":
            return SidelinkSettings(
                path_loss=parse_loss(self.loss),
                nakagami_m=parse_fading(self.fading),
                tx_power_dbm=self.tx_power_dbm,
            )
        same = set(CsmaSettings.model_fields) & set(RadioSettings.model_fields)
        return CsmaSettings(
            path_loss=parse_loss(self.loss),
            nakagami_m=parse_fading(self.fading),
            **{name: getattr(self, name) for name in same},
        )

    @property
    def distances_m(self) -> Array:
        """Distances (cars, cars) between all cars."""
        along_m = self.spacing_m * np.arange(self.cars)
        return np.abs(along_m[:, None] - along_m[None])


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioCase(Case):
    """One seed."""

    seed: int


def axes(settings: RadioSettings) -> Axes:
    """All seeds."""
    return {"seed": range(settings.seed, settings.seed + settings.seeds)}


@dataclass(frozen=True, slots=True)
class RadioRow:
    """One seed; all by bin of distance."""

    expected: list[int]
    """Copies that a loss-free channel would deliver."""
    received: list[int]
    expected_mid: list[int]
    """Of senders in the middle third."""
    received_mid: list[int]
    delay_sum_us: list[float]
    delay_p95_us: list[float | None]


@dataclass(frozen=True, slots=True)
class DistanceLine:
    """One line of the table: a bin of distance.

    As in the reference, `pdr_mid` (senders in the middle third) is 0 where there is no such pair,
    and delays are empty where nothing was received.
    """

    dist_lo_m: float
    pdr: float
    """Packet delivery ratio."""
    pdr_mid: float
    delay_mean_us: float | str
    delay_p95_us: float | str


RadioResults = Results[RadioSettings, RadioRow, DistanceLine]


def folder(settings: RadioSettings) -> str:
    """By a checksum of the settings, so that settings may change in one folder of the study."""
    return f"runs-{zlib.crc32(settings.model_dump_json().encode()):08x}"


def run(settings: RadioSettings, case: RadioCase) -> RadioRow:
    """Simulate one seed, and count frames by bin of distance."""
    rng = np.random.default_rng(case.seed)
    channel = broadcast_channel(settings.channel, settings.cars, rng)
    along_m = settings.spacing_m * np.arange(settings.cars)
    channel.receive_positions(np.column_stack([along_m, np.zeros(settings.cars)]))
    bin_of = (settings.distances_m / BIN_M + 1e-9).astype(np.int64)
    bins = int(bin_of.max()) + 1
    in_middle = np.zeros(settings.cars, dtype=np.bool_)
    in_middle[settings.cars // 3 : 2 * settings.cars // 3] = True
    sent = np.zeros(settings.cars, dtype=np.int64)
    for now, car in _queue_times(settings, rng):
        channel.receive_frame(car, settings.payload_bytes, settings.user_priority, now)
        # A frame that is still queued at the end counts as not delivered.
        sent[car] += now >= settings.warm_s
    channel.handle_timer(settings.seconds)
    senders, receivers, delays_us = _received_copies(settings, channel)
    pairs = np.array([np.bincount(row, minlength=bins) for row in bin_of])
    pairs[:, 0] -= 1  # a car does not receive its own frames
    bins_received, mid = bin_of[senders, receivers], in_middle[senders]
    by_bin = [delays_us[bins_received == each] for each in range(bins)]
    return RadioRow(
        expected=(sent @ pairs).tolist(),
        received=[len(each) for each in by_bin],
        expected_mid=((sent * in_middle) @ pairs).tolist(),
        received_mid=np.bincount(bins_received[mid], minlength=bins).tolist(),
        delay_sum_us=[float(each.sum()) for each in by_bin],
        delay_p95_us=[float(np.quantile(each, 0.95)) if len(each) else None for each in by_bin],
    )


def table(_settings: RadioSettings, rows: Sequence[RadioRow]) -> list[DistanceLine]:
    """A line for each bin.

    Raises:
        UserError: no frame was sent after the warm-up.
    """

    def total(name: str) -> Array:
        summed: Array = np.sum([getattr(row, name) for row in rows], axis=0, dtype=float)
        return summed

    expected, received, sums_us = total("expected"), total("received"), total("delay_sum_us")
    mid = total("received_mid") / np.maximum(total("expected_mid"), 1.0)
    lines = []
    for at in np.flatnonzero(expected).tolist():
        p95s_us = [us for row in rows if (us := row.delay_p95_us[at]) is not None]
        mean_us, p95_us = (
            (sums_us[at] / received[at], float(np.mean(p95s_us))) if p95s_us else ("", "")
        )
        pdr = received[at] / expected[at]
        lines.append(DistanceLine(BIN_M * at, pdr, mid[at], mean_us, p95_us))
    if not lines:
        raise UserError("radio: no frame was sent between warm_s and seconds")
    return lines


def summary(results: RadioResults) -> str:
    """Delivery ratio and delay of the nearest bin, and the range."""
    settings, lines = results.settings, results.table
    nearest = lines[0]
    text = f"{settings.cars} cars, {settings.seeds} seeds: nearest {nearest.pdr:.4f} delivered"
    if nearest.delay_mean_us:
        text += f" after {nearest.delay_mean_us:.0f} us"
    half_m = [line.dist_lo_m for line in lines if line.pdr >= 0.5]
    reach = f"up to the bin of {max(half_m):g} m" if half_m else "nowhere"
    return f"{text}; at least half {reach}"


def _queue_times(settings: RadioSettings, rng: np.random.Generator) -> Iterator[tuple[float, int]]:
    """Times at which cars queue a frame, in order."""
    begins_s = rng.uniform(0.0, settings.interval_s, settings.cars)
    queue = [(float(at_s), car) for car, at_s in enumerate(begins_s)]
    heapq.heapify(queue)
    while queue[0][0] < settings.seconds:
        now, car = queue[0]
        yield now, car
        next_s = now + settings.interval_s + float(rng.uniform(0.0, settings.jitter_s))
        heapq.heapreplace(queue, (next_s, car))


def _received_copies(
    settings: RadioSettings, channel: Channel | SidelinkChannel
) -> tuple[Indices, Indices, Array]:
    """Sender, receiver and delay in us of each copy of what was queued after the warm-up."""
    empty = Reception(0, 0, 0.0, 0.0, np.zeros(0, dtype=np.int64), np.zeros(0))
    receptions = [
        empty,
        *(each for each in iter(channel.next_event, None) if each.queued_s >= settings.warm_s),
    ]
    copies = [len(each.receivers) for each in receptions]
    senders = np.repeat([each.sender for each in receptions], copies)
    receivers = np.concatenate([each.receivers for each in receptions])
    queued_s = np.repeat([each.queued_s for each in receptions], copies)
    return senders, receivers, 1e6 * (np.concatenate([each.at_s for each in receptions]) - queued_s)


def picture(results: RadioResults) -> Figure:
    """Draw delivery and delay over the distance."""
    settings, lines = results.settings, results.table
    figure = Figure(figsize=(7.0, 6.0), layout="constrained")
    delivered, delays = figure.subplots(2, 1, sharex=True)
    middle_m = [line.dist_lo_m + BIN_M / 2.0 for line in lines]
    delivered.plot(middle_m, [line.pdr for line in lines], "o-", ms=3, label="all senders")
    has_mid = [(at, line.pdr_mid) for at, line in zip(middle_m, lines, strict=True) if line.pdr_mid]
    if has_mid:
        delivered.plot(*zip(*has_mid, strict=True), "s--", ms=3, label="middle third")
    delivered.set(ylabel="packet delivery ratio", ylim=(0.0, 1.02))
    delivered.legend(frameon=False)
    for column, label in (("delay_mean_us", "mean"), ("delay_p95_us", "95th percentile")):
        values = [getattr(line, column) for line in lines]
        known = [(at, value) for at, value in zip(middle_m, values, strict=True) if value]
        if known:
            delays.plot(*zip(*known, strict=True), "o-", ms=3, label=label)
            delays.legend(frameon=False)
    delays.set(xlabel="m between the cars", ylabel="delay in us")
    delays.set_ylim(bottom=0.0)
    figure.suptitle(
        f"{settings.cars} cars, {settings.spacing_m:g} m apart, {settings.loss},"
        f" fading {settings.fading}"
    )
    return figure


STUDY = Study(
    name="radio",
    sentence="How the 802.11p channel delivers in a line of cars, beside ns-3.",
    settings=RadioSettings,
    axes=axes,
    case=RadioCase,
    run=run,
    row=RadioRow,
    folder=folder,
    table=table,
    line=DistanceLine,
    picture=picture,
    summary=summary,
)
