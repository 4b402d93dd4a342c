"""What a user may set about shared sensing."""

from enum import StrEnum

from pydantic import Field

from onboard.messages.bsm import MAX_FOOTER_BYTES
from onboard.settings import Settings


class Selection(StrEnum):
    """How a car chooses what to broadcast (section V-A)."""

    MVS = "mvs"
    """Algorithm 1 of the paper."""
    MEASUREMENTS_ONLY = "mo"
    """The paper's first baseline: measurements at random, no estimates."""
    RANDOM = "rs"
    """The paper's second baseline: one measurement or estimate a car, cars at random."""


class SensingSettings(Settings):
    """From what the camera sees to a measurement."""

    camera_ahead_m: float = Field(0.0, ge=-10.0, le=10.0)
    """Camera ahead of the point that the GNSS receiver reports."""
    face_to_centre_m: float = Field(2.2, ge=0.0, le=10.0)
    """From the side of a car that the camera measures to its middle, which is what is shared."""
    face_to_centre_sigma_m: float = Field(0.5, ge=0.0, le=5.0)
    """Cars are not equally long, nor always seen from behind."""
    heading_sigma_rad: float = Field(0.02, gt=0.0, le=0.5)
    """Of the angle between the camera's axis and the course, which no fix tells: how it is mounted,
    and how the car drifts."""
    velocity_sigma_m_s: float = Field(0.1, gt=0.0, le=2.0)
    """Of the receiver's velocity, on either axis: a course is wrong by this over the speed."""
    heading_held_below_m_s: float = Field(1.0, gt=0.0, le=10.0)
    """Slower than this, the course tells nothing, and what is known of the heading is kept."""
    position_held_s: float = Field(1.5, gt=0.0, le=10.0)
    """How long a fix is carried on at its speed before the position counts as missing."""


class AssociationSettings(Settings):
    """Which piece of evidence belongs to which car."""

    gate_probability: float = Field(0.9999, gt=0.5, lt=1.0)
    """Share of a car's evidence that its gate lets in. Wide: of each car a hundred pieces come
    every second, and what the gate leaves out begins a track of its own."""
    recognition_probability: float = Field(0.9, gt=0.5, lt=1.0)
    """The gate in which a track counts as a car with a radio. Narrower, since a car that is taken
    for its neighbour is hidden, while one that is missed is found at the next moment."""
    speed_sigma_m_s: float = Field(20.0, gt=0.0, le=100.0)
    """Cars are about this fast; used where nothing else is known of a car's speed."""
    radio_offset_sigma_m: float = Field(0.5, ge=0.0, le=10.0)
    """What a BSM's position and the middle of the seen car may differ by, over their own noise."""
    certain_m: float = Field(0.75, gt=0.0, le=5.0)
    """Evidence whose place is less certain than this (root of the summed variances) is not assigned
    by place alone: cars are 3 m apart. For joining two tracks the bound grows with the age of the
    younger, to twice this after 0.25 s and five times after 1 s: otherwise a car that is only ever
    seen vaguely would stay two."""
    overlap_m: float = Field(1.5, ge=0.0, le=5.0)
    """Middles closer than this are one car: two cannot be."""


class FooterValidationSettings(Settings):
    """What is believed of what comes over the air; see the decision on hostile footers."""

    clock_tolerance_s: float = Field(0.1, ge=0.0, le=1.0)
    """How far ahead of ours a sender's clock may be."""
    radio_range_m: float = Field(1500.0, gt=0.0, le=10_000.0)
    """Nobody is heard from farther away."""
    sensing_range_m: float = Field(200.0, gt=0.0, le=1000.0)
    """No camera or radar places a car farther away than this."""
    fastest_m_s: float = Field(90.0, gt=0.0, le=200.0)
    sharpest_sigma_m: float = Field(0.1, gt=0.0, le=10.0)
    """No single measurement is better than this; estimates are limited by what it allows them."""
    vaguest_sigma_m: float = Field(30.0, gt=0.0, le=1000.0)
    """A position worse than this tells nothing."""
    footers_per_s: float = Field(20.0, gt=0.0, le=100.0)
    """Of one sender; what comes faster for long is dropped."""
    footers_at_once: int = Field(5, ge=1, le=100)
    """Of one sender: one that is held up on its way arrives together with the next ones."""
    senders: int = Field(512, ge=1, le=10_000)
    entries_per_footer: int = Field(64, ge=1, le=510)
    cars: int = Field(256, ge=1, le=10_000)
    """Without a radio, known at once."""
    cars_per_sender: int = Field(64, ge=1, le=1000)
    """That only this sender tells of."""
    evidence_per_car: int = Field(128, ge=8, le=1000)
    estimates_per_car: int = Field(48, ge=1, le=1000)
    measurements_per_estimate: int = Field(64, ge=1, le=1000)


class MvsSettings(Settings):
    """Shared sensing of cars without a radio."""

    selection: Selection = Selection.MVS
    most_entries: int = Field(10, ge=0, le=64)
    """M: measurements and estimates in one footer."""
    most_bytes: int = Field(MAX_FOOTER_BYTES, ge=18, le=MAX_FOOTER_BYTES)
    """Of the footer: what BSM and signature leave of a WSM."""
    shared_span_s: float = Field(0.5, gt=0.0, le=4.0)
    """The oldest measurement in anything that is broadcast is not older than this."""
    settled_s: float = Field(0.6, gt=0.0, le=4.0)
    """Evidence older than this is chosen for good: more than `shared_span_s`, so that what still
    comes in has little in common with it."""
    memory_s: float = Field(2.0, gt=0.0, le=10.0)
    """Measurements older than this are not used."""
    acceleration_density: float = Field(2.0, gt=0.0, le=100.0)
    """q of the process noise, m^2/s^3: speeds drift by sqrt(q) m/s in one second."""
    refresh_s: float = Field(0.05, ge=0.0, le=1.0)
    """What has come in is fused when somebody asks, but no more often than this."""
    confirmed_by: int = Field(3, ge=1, le=20)
    """A car is known, and passed on, with evidence of so many different moments."""
    unseen_s: float = Field(1.5, gt=0.0, le=10.0)
    """A car that nobody has measured for this long is forgotten."""
    vaguest_known_m: float = Field(4.0, gt=0.0, le=100.0)
    """A car whose place is less certain than this (root of the summed variances) is not known."""
    radio_silence_s: float = Field(1.5, gt=0.0, le=10.0)
    """A car with a radio that has been silent for this long is not one any more."""
    sensing: SensingSettings = SensingSettings()
    association: AssociationSettings = AssociationSettings()
    footer_validation: FooterValidationSettings = FooterValidationSettings()
