"""The MVS footer: sizes, round trips over the declared ranges, and invalid bytes."""

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.errors import DecodeError
from onboard.messages import mvs_footer
from onboard.messages.mvs_footer import (
    HEADER,
    MEASUREMENT,
    STATE,
    MvsFooter,
    ObserverRun,
    SharedEstimate,
    SharedMeasurement,
    SharedState,
    StandardDeviation,
    decode,
    encode,
)

MEASURED = SharedMeasurement(0, 9, 100, 0, 12.34, -56.78, 0.5, 0.7, 0.25)
STATED = SharedState(
    8, -100.0, 200.0, 13.88, -0.02, 0.4, 0.4, 1.1, 1.2, 0.0, 0.75, 0.0, 0.0, 0.75, 0.125, runs=2
)
ESTIMATED = SharedEstimate(STATED, (ObserverRun(0, (0, 100, 200)), ObserverRun(1, (50,))))
FOOTER = MvsFooter(
    1_700_000_000_000, 48.1234567, -11.7654321, (b"abcd", b"efgh"), (MEASURED,), (ESTIMATED,)
)

ages = st.integers(0, 4095)
run = st.builds(
    ObserverRun, st.integers(0, 3), st.lists(ages, min_size=1, max_size=16, unique=True).map(tuple)
)
runs = st.lists(run, min_size=1, max_size=5, unique_by=lambda run: run.observer).map(tuple)


def raw_entries(size_bytes: int) -> st.SearchStrategy[bytes]:
    return st.binary(min_size=size_bytes, max_size=size_bytes)


def test_entry_sizes_are_those_of_the_documentation() -> None:
    assert (HEADER.size_bytes, MEASUREMENT.size_bytes, STATE.size_bytes) == (18, 12, 21)
    provenance_bytes = (2 * 12 + 4 * 12 + 7) // 8
    assert len(encode(FOOTER)) == 18 + 2 * 4 + 12 + 21 + provenance_bytes


def test_ten_cars_measured_three_times_by_four_observers_fit_500_bytes() -> None:
    twelve = tuple(ObserverRun(observer, (5, 105, 205)) for observer in range(4))
    estimate = SharedEstimate(dataclasses.replace(STATED, runs=4), twelve)
    observers = (b"abcd", b"efgh", b"ijkl", b"mnop")
    footer = dataclasses.replace(
        FOOTER, observers=observers, measurements=(), estimates=(estimate,) * 10
    )

    assert len(encode(footer)) == 484


def test_a_footer_is_decoded_as_it_was_encoded() -> None:
    came = decode(encode(FOOTER))

    assert came.reference_ms == FOOTER.reference_ms
    assert came.latitude_deg == pytest.approx(FOOTER.latitude_deg, abs=5e-8)
    assert came.longitude_deg == pytest.approx(FOOTER.longitude_deg, abs=5e-8)
    assert came.observers == FOOTER.observers
    assert came.estimates[0].provenance == ESTIMATED.provenance
    assert came.measurements[0].east_m == pytest.approx(12.34)
    assert came.estimates[0].state.speed_north_m_s == pytest.approx(-0.02)


@given(
    st.lists(raw_entries(MEASUREMENT.size_bytes), max_size=4),
    st.lists(st.tuples(raw_entries(STATE.size_bytes), runs), max_size=4),
)
def test_every_entry_that_can_be_decoded_is_encoded_to_the_same_bytes(
    measurements: list[bytes], estimates: list[tuple[bytes, tuple[ObserverRun, ...]]]
) -> None:
    try:
        footer = dataclasses.replace(
            FOOTER,
            observers=(b"1111", b"2222", b"3333", b"4444"),
            measurements=tuple(
                dataclasses.replace(MEASUREMENT.decode(data), observer=1) for data in measurements
            ),
            estimates=tuple(
                SharedEstimate(
                    dataclasses.replace(STATE.decode(data), runs=len(provenance)), provenance
                )
                for data, provenance in estimates
            ),
        )
    except DecodeError:
        return  # a code that the declaration gives no meaning

    data = encode(footer)

    assert encode(decode(data)) == data
    assert [e.provenance for e in decode(data).estimates] == [
        e.provenance for e in footer.estimates
    ]


@given(st.floats(0.01, 1900))
def test_a_standard_deviation_is_rounded_up_by_at_most_one_step(sigma: float) -> None:
    sent = StandardDeviation("m").from_raw(StandardDeviation("m").to_raw(sigma))

    assert sigma * (1 - 1e-6) <= sent <= sigma * 1.0121


def test_a_standard_deviation_beyond_the_range_is_sent_as_its_end() -> None:
    assert StandardDeviation("m").to_raw(1e-9) == 0
    assert StandardDeviation("m").to_raw(1e9) == 1023
    with pytest.raises(ValueError, match="no standard deviation"):
        StandardDeviation("m").to_raw(0.0)


@pytest.mark.parametrize("size", range(len(encode(FOOTER))))
def test_a_truncated_footer_is_too_short(size: int) -> None:
    with pytest.raises(DecodeError, match="too_short"):
        decode(encode(FOOTER)[:size])


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (encode(FOOTER) + b"\0", "trailing_bytes"),
        (b"\x03" + encode(FOOTER)[1:], "unknown_version"),
        (encode(dataclasses.replace(FOOTER, observers=(b"abcd",))), "unknown_observer"),
        (
            encode(
                dataclasses.replace(
                    FOOTER,
                    estimates=(SharedEstimate(dataclasses.replace(STATED, runs=0), ()),),
                )
            ),
            "empty_provenance",
        ),
        (
            encode(
                dataclasses.replace(
                    FOOTER,
                    estimates=(
                        SharedEstimate(STATED, (ObserverRun(0, (5,)), ObserverRun(0, (7, 5)))),
                    ),
                )
            ),
            "repeated_measurement",
        ),
        (
            encode(
                dataclasses.replace(
                    FOOTER,
                    estimates=(
                        SharedEstimate(
                            dataclasses.replace(STATED, runs=1), (ObserverRun(0, (5, 6)),)
                        ),
                    ),
                )
            )[:-1]
            + b"\xff",
            "out_of_range",
        ),
        (encode(FOOTER)[:7] + b"\x7f" + encode(FOOTER)[8:], "out_of_range"),
    ],
)
def test_an_invalid_footer_is_refused_with_its_reason(data: bytes, reason: str) -> None:
    with pytest.raises(DecodeError) as error:
        decode(data)

    assert error.value.reason == reason


@given(st.binary(max_size=300))
def test_any_bytes_give_a_footer_or_a_decode_error(data: bytes) -> None:
    try:
        footer = decode(b"\x01" + data)
    except DecodeError:
        return
    assert mvs_footer.as_dict(footer)


@pytest.mark.parametrize(
    "change",
    [
        {"observers": (b"abc",)},
        {"observers": tuple(b"abcd" for _ in range(256))},
        {"reference_ms": -1},
        {"measurements": (dataclasses.replace(MEASURED, age_ms=4096),)},
        {"estimates": (SharedEstimate(STATED, ()),)},
        {"estimates": (SharedEstimate(STATED, (ObserverRun(0, ()), ObserverRun(1, (1,)))),)},
        {"estimates": (SharedEstimate(STATED, (ObserverRun(0, (4096,)), ObserverRun(1, (1,)))),)},
        {"estimates": (SharedEstimate(STATED, (ObserverRun(256, (1,)), ObserverRun(1, (1,)))),)},
    ],
)
def test_a_footer_that_cannot_be_encoded_is_a_value_error(change: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        encode(dataclasses.replace(FOOTER, **change))  # type: ignore[arg-type]


def test_a_trace_line_names_observers_and_ages() -> None:
    line = mvs_footer.as_dict(FOOTER)

    assert line["observers"] == ["61626364", "65666768"]
    assert line["estimates"][0]["provenance"] == {"0": (0, 100, 200), "1": (50,)}
