"""Cases of the fault study: each fault in severities from mild to severe."""

from dataclasses import dataclass, field
from typing import Any

FROM_S, UNTIL_S = 12.0, 29.0
"""Begin and end of a fault; losses of the radio last for the whole run."""


@dataclass(frozen=True, slots=True)
class FaultCase:
    """One fault of one severity."""

    fault: str
    severity: str
    car: str = "red"
    faults: tuple[dict[str, Any], ...] = ()
    """Faults of the scenario, without car and times."""
    radio: dict[str, Any] = field(default_factory=dict)
    """Settings of the radio channel."""
    signed: bool = False
    """Whether messages are signed, which takes computing time."""
    until_s: float = UNTIL_S
    """End of the fault."""


def _radio(fault: str, setting: str, values: tuple[float, ...], unit: str = "") -> list[FaultCase]:
    return [FaultCase(fault, f"{value:g}{unit}", radio={setting: value}) for value in values]


def _lasting(fault: str, what: str, *cars: str) -> list[FaultCase]:
    return [FaultCase(fault, "all the time", car, ({"what": what},)) for car in cars]


def _graded(
    fault: str,
    what: str,
    setting: str,
    values: tuple[float, ...],
    unit: str,
    *,
    car: str = "red",
    signed: bool = False,
    **more: Any,
) -> list[FaultCase]:
    return [
        FaultCase(
            fault, f"{value:g}{unit}", car, ({"what": what, setting: value, **more},), signed=signed
        )
        for value in values
    ]


CASES = (
    FaultCase("none", ""),
    FaultCase("none", "signed", signed=True),
    *_radio("loss", "loss", (0.1, 0.3, 0.6, 0.9)),
    *_radio("delay", "delay_s", (0.05, 0.2, 1.0), " s"),
    *_radio("duplication", "duplication", (0.3, 1.0)),
    *_radio("reordering", "reordering", (0.3, 0.8)),
    *_lasting("radio gone", "radio_gone", "green", "red"),
    *_lasting("radio mute", "radio_mute", "green", "red"),
    *_lasting("ECU silent", "ecu_stopped", "green", "red"),
    *_lasting("ECU refuses", "ecu_refuses", "green", "red"),
    *_graded("ECU babbles", "ecu_babbles", "rate_hz", (100.0, 1000.0, 4000.0), "/s", car="green"),
    *_graded("speed scaled", "speed_scaled", "factor", (0.5, 0.9, 1.1, 2.0), "x", car="green"),
    *_graded("speed scaled", "speed_scaled", "factor", (0.5, 0.9, 1.1, 2.0), "x", car="red"),
    *_lasting("camera frozen", "camera_frozen", "red"),
    *_lasting("camera dark", "camera_dark", "red"),
    *_graded(
        "plate misread",
        "plate_misread",
        "rate",
        (0.03, 0.1, 0.3, 1.0),
        "",
        of="green",
        reads="GN417XB",
    ),
    FaultCase(
        "plate misread",
        "1 for 10 s",
        faults=({"what": "plate_misread", "rate": 1.0, "of": "green", "reads": "GN417XB"},),
        until_s=22.0,
    ),
    *_lasting("GNSS silent", "gnss_silent", "red"),
    *_graded("GNSS jump", "gnss_jump", "north_m", (10.0, 50.0, 500.0), " m"),
    *_graded("clock skew", "clock_wrong", "skew_s", (-1.0, 1.0, 3.0, 600.0), " s", signed=True),
    *_graded("clock drift", "clock_wrong", "drift_ppm", (100.0, 100_000.0), " ppm", signed=True),
    *_graded("slow CPU", "cpu_slow", "share", (0.5, 0.2, 0.05), ""),
    *_graded("forged brake", "forged_brake", "every_s", (2.0,), " s", signed=True),
    *_graded("ghost car", "ghost_car", "every_s", (4.0,), " s", car="green", signed=True),
    *_graded("replay", "replay", "delay_s", (0.5, 4.0), " s", car="green", signed=True),
    *_graded("replay", "replay", "delay_s", (0.5, 4.0), " s, unsigned", car="green"),
)
