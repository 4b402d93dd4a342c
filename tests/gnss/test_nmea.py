"""Positions from a receiver's sentences: incomplete, repeated, truncated or invalid."""

import datetime as dt
import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.gnss.nmea import NmeaReader
from onboard.gnss.nmea_sentence import SentenceError, parse
from onboard.gnss.settings import GnssSettings
from onboard.kinematics.units import KNOT
from onboard.observations import Discarded, Position
from tests.typed import a, about, every

RMC = "GNRMC,045000.34,A,5606.25716,N,01008.71506,E,30.567,45.00,260721,,,A"
GGA = "GNGGA,045000.34,5606.25716,N,01008.71506,E,1,10,1.0,20.0,M,43.5,M,,"
NO_FIX = "GNRMC,045009.00,V,,,,,,,260721,,,N"
"""A sentence that begins another epoch, without a position."""

GST = "GNGST,045000.34,1.2,2.0,1.0,30.0,3.0,4.0,5.0"


def sentence(text: str) -> bytes:
    """With its checksum (IEC 61162-1): the XOR of all characters."""
    total = 0
    for character in text:
        total ^= ord(character)
    return f"${text}*{total:02X}\r\n".encode("ascii")


def read(
    *texts: bytes | str, now: float | None = None, settings: GnssSettings | None = None
) -> list[Discarded | Position]:
    reader = NmeaReader(settings)
    for text in texts:
        reader.receive_bytes(text if isinstance(text, bytes) else sentence(text), now)
    if now is None:
        reader.receive_end()
    return events_of(reader)


def events_of(reader: NmeaReader) -> list[Discarded | Position]:
    return list(iter(reader.next_event, None))


def positions_in(*texts: bytes | str, settings: GnssSettings | None = None) -> list[Position]:
    return every(Position, read(*texts, settings=settings))


def utc(*when: int) -> float:
    year, month, day, hour, minute, second, microsecond = (*when, 0, 0, 0, 0)[:7]
    there = dt.datetime(year, month, day, hour, minute, second, microsecond, dt.UTC)
    return there.timestamp()


def at(text: str, time: str, date: str | None = None) -> str:
    changed = text.replace("045000.34", time)
    return changed if date is None else changed.replace("260721", date)


def test_one_position_from_the_sentences_of_one_instant() -> None:
    (position,) = positions_in(RMC, GGA, NO_FIX)
    assert position == Position(
        stamp_s=about(utc(2021, 7, 26, 4, 50, 0, 340_000)),
        latitude_deg=about(56 + 6.25716 / 60),
        longitude_deg=about(10 + 8.71506 / 60),
        altitude_m=about(63.5),
        sigma_m=about(4.0 / math.sqrt(2)),
        speed_m_s=about(30.567 * KNOT),
        course_rad=about(math.pi / 4),
    )


@pytest.mark.parametrize(
    ("latitude", "longitude", "expected"),
    [
        ("4552.65403,S", "17030.00668,E", (-45.8775671667, 170.5001113333)),
        ("4404.1237962,N", "12118.8472460,W", (44.06872993667, -121.31412076667)),
        ("0000.0000,N", "00000.0600,W", (0.0, -0.001)),
        ("9000.0000,S", "18000.0000,E", (-90.0, 180.0)),
    ],
)
def test_hemispheres(latitude: str, longitude: str, expected: tuple[float, float]) -> None:
    text = f"GPRMC,045000,A,{latitude},{longitude},0.0,,260721,,,A"
    (position,) = positions_in(text, NO_FIX)
    assert (position.latitude_deg, position.longitude_deg) == pytest.approx(expected)


def test_from_the_second_epoch_on_a_position_comes_with_the_last_sentence() -> None:
    reader = NmeaReader()
    for text in (RMC, GGA, at(RMC, "045001.34")):
        reader.receive_bytes(sentence(text), now=3.0)
    assert len(events_of(reader)) == 1
    reader.receive_bytes(sentence(at(GGA, "045001.34")), now=3.0)
    assert len(events_of(reader)) == 1


VTG = "GNVTG,45.00,T,,M,30.567,N,56.610,K,A"
GLL = "GNGLL,5606.25716,N,01008.71506,E,045000.34,A,A"


@pytest.mark.parametrize("texts", [(GGA, VTG), (VTG, GGA, GLL, VTG), (GGA, VTG, GST)])
def test_velocity_from_vtg(texts: tuple[str, ...]) -> None:
    (position,) = positions_in("GNZDA,045000.34,26,07,2021,00,00", *texts, NO_FIX)
    assert position.speed_m_s == pytest.approx(30.567 * KNOT)
    assert position.course_rad == pytest.approx(math.pi / 4)


@pytest.mark.parametrize(
    "vtg", ["GNVTG,,T,,M,,N,,K,N", "GNVTG,45,T,,M,9,N,17,K,N", "GNVTG,45,9,9,9"]
)
def test_vtg_without_velocity_states_none(vtg: str) -> None:
    (position,) = positions_in(RMC.replace("30.567,45.00", ","), GGA, vtg, NO_FIX)
    assert (position.speed_m_s, position.course_rad) == (None, None)


def test_a_rmc_after_one_of_several_gga_has_its_speed() -> None:
    """After the first, whose lateness nobody can foresee live."""
    reader = NmeaReader()
    for tenth in range(100):
        time = f"0450{tenth // 10:02}.{tenth % 10}0"
        reader.receive_bytes(sentence(at(GGA, time)), now=tenth / 10)
        if tenth % 10 == 5:
            reader.receive_bytes(sentence(at(RMC, time)), now=tenth / 10 + 0.03)
    positions = every(Position, events_of(reader))
    assert len(positions) == 99
    assert [position.speed_m_s is not None for position in positions].count(True) == 9


def test_a_recorded_rmc_that_comes_late_has_its_speed() -> None:
    later = [at(text, "045001.34") for text in (GGA, RMC)]
    positions = positions_in(RMC, GGA, *later, NO_FIX)
    assert [position.speed_m_s for position in positions] == [pytest.approx(30.567 * KNOT)] * 2


@pytest.mark.parametrize("cut", [0, 2], ids=["whole", "without line end"])
def test_the_last_fix_of_a_recording_is_reported_at_its_end(cut: int) -> None:
    reader = NmeaReader()
    data = sentence(GGA) + sentence(RMC)
    reader.receive_bytes(data[: len(data) - cut])
    assert events_of(reader) == []
    reader.receive_end()
    (position,) = every(Position, events_of(reader))
    assert position.speed_m_s is not None
    reader.receive_end()
    assert events_of(reader) == []


def test_a_receiver_that_changes_its_order_loses_no_position() -> None:
    first = [RMC, GGA, GST]
    second = [at(RMC, "045001.34"), at(GGA, "045001.34")]
    third = [at(RMC, "045002.34")]
    assert len(read(*first, *second, *third, at(GGA, "045003.34"))) == 4


def test_the_receivers_own_accuracy_takes_precedence() -> None:
    (position,) = positions_in(RMC, GGA, GST, NO_FIX)
    assert position.sigma_m == pytest.approx(math.sqrt((3.0**2 + 4.0**2) / 2))


@pytest.mark.parametrize(
    ("quality", "hdop", "sigma_m"),
    [
        (1, "1.0", 4.0 / math.sqrt(2)),
        (1, "2.5", 10.0 / math.sqrt(2)),
        (1, "", 8.0 / math.sqrt(2)),
        (1, "99.99", 8.0 / math.sqrt(2)),
        (2, "1.0", 2.0 / math.sqrt(2)),
        (6, "1.0", 12.0 / math.sqrt(2)),
        (4, "1.0", 0.5),
    ],
)
def test_accuracy_from_dilution_and_quality_but_never_below_the_least(
    quality: int, hdop: str, sigma_m: float
) -> None:
    gga = GGA.replace(",E,1,10,1.0,", f",E,{quality},10,{hdop},")
    (position,) = positions_in(RMC, gga, NO_FIX)
    assert position.sigma_m == pytest.approx(sigma_m)


def test_the_settings_allow_the_accuracy_of_rtk() -> None:
    gga = GGA.replace(",E,1,10,1.0,", ",E,4,10,1.0,")
    settings = GnssSettings(least_sigma_m=0.01)
    (position,) = positions_in(RMC, gga, NO_FIX, settings=settings)
    assert position.sigma_m == pytest.approx(0.04 / math.sqrt(2))


def test_unstated_values_are_none() -> None:
    (position,) = positions_in("GPRMC,045000.34,A,5606.25716,N,01008.71506,E,,,260721,,", NO_FIX)
    assert (position.speed_m_s, position.course_rad, position.altitude_m) == (None, None, None)


def test_several_systems_in_one_gns() -> None:
    gns = "GNGNS,045000.34,5606.25716,N,01008.71506,E,AAN,12,0.8,20.0,43.5,,"
    (position,) = positions_in(RMC, gns, NO_FIX)
    assert position.altitude_m == pytest.approx(63.5)
    assert position.sigma_m == pytest.approx(0.8 * 4.0 / math.sqrt(2))


@pytest.mark.parametrize(
    "no_fix",
    [
        RMC.replace(",A,5606", ",V,5606"),
        RMC.replace(",,A", ",,N"),
        RMC.replace(",,A", ",,S"),
        "GPRMC,045000.34,V,,,,,,,260721,,,N",
        "GPRMC,045000.34,V,8960.0,N,00000.0,E,0.0,0.0,260721,,,N",
        GGA.replace(",E,1,", ",E,0,"),
        GGA.replace(",E,1,", ",E,8,"),
        GGA.replace(",E,1,", ",E,,"),
        "GNGNS,045000.34,,,,,NN,00,,,,,",
    ],
)
def test_no_fix_is_no_position_and_no_fault(no_fix: str) -> None:
    assert read(no_fix, NO_FIX) == []


def test_one_sentence_without_a_fix_voids_the_epoch() -> None:
    assert read(RMC, GGA.replace(",E,1,", ",E,0,"), NO_FIX) == []


@pytest.mark.parametrize("order", [(RMC, GGA), (GGA, RMC)])
def test_midnight(order: tuple[str, str]) -> None:
    texts = [at(t, "235959.00", "311223") for t in order]
    texts += [at(t, "000000.00", "010124") for t in order]
    texts += [at(t, "000001.00", "010124") for t in order]
    stamps = [position.stamp_s for position in read(*texts)]
    assert stamps == [utc(2023, 12, 31, 23, 59, 59), utc(2024, 1, 1), utc(2024, 1, 1, 0, 0, 1)]


def test_midnight_of_a_receiver_that_sends_its_date_once() -> None:
    texts = ["GPZDA,235958.00,31,12,2023,00,00"]
    texts += [at(GGA, time) for time in ("235959.00", "000000.00", "000001.00", "000002.00")]
    stamps = [position.stamp_s for position in read(*texts)]
    assert stamps == [utc(2023, 12, 31, 23, 59, 59) + n for n in range(4)]


def test_midnight_of_a_receiver_that_sends_its_date_before_each_position() -> None:
    times = {"235959.00": "31,12,2023", "000000.00": "01,01,2024", "000001.00": "01,01,2024"}
    texts = [t for time, day in times.items() for t in (f"GPZDA,{time},{day},00,00", at(GGA, time))]
    stamps = [position.stamp_s for position in read(*texts)]
    assert stamps == [utc(2023, 12, 31, 23, 59, 59) + n for n in range(3)]


def test_a_recording_without_a_date_has_no_stamps_and_is_discarded() -> None:
    discarded, *_ = read(GGA, at(GGA, "045001.34"), at(GGA, "045002.34"))
    assert a(Discarded, discarded).reason == "nmea_no_date"


def test_live_positions_are_stamped_by_the_daemons_clock() -> None:
    reader = NmeaReader(GnssSettings(latency_s=0.1))
    for n in range(3):
        for text in (RMC, GGA):
            reader.receive_bytes(sentence(at(text, f"04500{n}.00")), 1000.15 + n)
    stamps = [position.stamp_s for position in events_of(reader)]
    assert stamps == pytest.approx([1000.05, 1001.05, 1002.05])


def test_a_live_receiver_without_a_date_is_stamped_by_arrival() -> None:
    reader = NmeaReader(GnssSettings(latency_s=0.1))
    for n in range(3):
        reader.receive_bytes(sentence(at(GGA, f"04500{n}.00")), 1000.15 + n)
    stamps = [position.stamp_s for position in events_of(reader)]
    assert stamps == pytest.approx([1000.05, 1001.05, 1002.05])


@given(cuts=st.lists(st.integers(0, 400), max_size=8))
def test_bytes_may_be_split_anywhere(cuts: list[int]) -> None:
    texts = [at(t, f"04500{n}.00") for n in range(3) for t in (RMC, GGA)]
    stream = b"".join(map(sentence, texts))
    edges = [0, *sorted(min(cut, len(stream)) for cut in cuts), len(stream)]
    parts = [stream[a:b] for a, b in pairwise(edges)]
    assert read(*parts) == read(*texts)


@pytest.mark.parametrize(
    "damaged",
    [
        sentence(RMC).replace(b"5606", b"5607"),
        sentence(RMC)[:40] + b"\r\n",
        sentence(RMC)[:-4] + b"\r\n",
        sentence(RMC)[:30],
    ],
)
def test_a_damaged_sentence_is_discarded_and_the_next_one_is_read(damaged: bytes) -> None:
    discarded, position = read(damaged, at(RMC, "045001.34"), NO_FIX)
    assert isinstance(discarded, Discarded)
    assert (discarded.component, discarded.reason) == ("gnss", "nmea_checksum")
    assert position.stamp_s == pytest.approx(utc(2021, 7, 26, 4, 50, 1, 340_000))


@pytest.mark.parametrize(
    "wrong",
    [
        RMC.replace("5606.25716", "9106.25716"),
        RMC.replace("5606.25716", "5660.25716"),
        RMC.replace("01008.71506,E", "18100.0,E"),
        RMC.replace(",N,", ",X,"),
        RMC.replace("045000.34", "250000.00"),
        RMC.replace("045000.34", "noon"),
        RMC.replace("260721", "310221"),
        RMC.replace("30.567", "-1"),
        RMC.replace("30.567", "nan"),
        RMC.replace("45.00", "361"),
        GGA.replace(",E,1,", ",E,x,"),
        GGA.replace("20.0,M", "1e9,M"),
    ],
)
def test_an_invalid_field_is_discarded(wrong: str) -> None:
    with pytest.raises(SentenceError) as refused:
        parse(sentence(wrong))
    assert refused.value.reason == "nmea_field"


@pytest.mark.parametrize(
    "other",
    [
        b"",
        b"# a comment\r\n",
        b"\xb5\x62\x01\x07\x5c\x00\r\n",
        sentence("GPGSV,2,1,07,10,46,196,10,29,68,310,42"),
        sentence("PUBX,00,045000.34,5606.25716,N,01008.71506,E"),
        sentence("PMGNS,02.46,3,T"),
        b"!AIVDM,1,1,,A,15RTgt0PAso;90TKcjM8h6g208CQ,0*4A\r\n",
    ],
)
def test_sentences_without_a_position_are_ignored(other: bytes) -> None:
    assert parse(other) is None


def test_binary_messages_between_sentences_are_ignored() -> None:
    noise = bytes(range(256)).replace(b"$", b"") * 8
    texts = [at(t, f"04500{n}.00") for n in range(3) for t in (RMC, GGA)]
    mixed = [part for text in texts for part in (sentence(text), noise, b"\n")]
    assert read(*mixed) == read(*texts)


@given(st.binary(max_size=300), st.sampled_from([b"$GPRMC,", b"$GPGGA,", b"$GNGST,", b""]))
def test_no_bytes_raise(data: bytes, start: bytes) -> None:
    for event in read(start + data + b"\n", sentence(RMC), sentence(at(RMC, "045001.34"))):
        assert isinstance(event, Position | Discarded)
