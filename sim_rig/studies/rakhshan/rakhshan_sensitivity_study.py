"""The reduction by driver-based access for variants of what the paper leaves open."""

from collections.abc import Sequence
from dataclasses import dataclass

from sim_rig.studies.campaigns.study import Case, Results, Study
from sim_rig.studies.rakhshan.best_access import BROAD, RakhshanSettings, gain, simulate
from sim_rig.studies.rakhshan.highway import Spacing

VARIANTS: dict[str, dict[str, object]] = {
    "baseline": {},
    "uniform gaps": {"spacing": Spacing.UNIFORM},
    "log-normal gaps": {"spacing": Spacing.LOGNORMAL},
    "mean gap 12 m": {"mean_gap_m": 12.0},
    "mean gap 35 m": {"mean_gap_m": 35.0},
    "path loss exponent 2": {"path_loss_exponent": 2.0},
    "path loss exponent 4": {"path_loss_exponent": 4.0},
    "reaction times x 0.6": {"reaction_factor": 0.6},
    "reaction times x 1.5": {"reaction_factor": 1.5},
    "unsafe above 0.3": {"unsafe_threshold": 0.3},
    "unsafe above 0.8": {"unsafe_threshold": 0.8},
    "random waits": {"random_waits": True},
    "asynchronous slots": {"synchronous": False},
    "one lane": {"lanes": 1},
    "slots of 2.2 ms": {"slots_per_packet": 10.0},
    "slots of 11 ms": {"slots_per_packet": 50.0},
    "slots of 44 ms": {"slots_per_packet": 200.0},
}
"""Changes of the settings, one at a time."""


@dataclass(frozen=True, slots=True)
class VariantLine:
    """One line of the table: a variant with one kind of labels."""

    variant: str
    labels: str
    unsafe_share: float
    without_radio: float
    least_with_equal_access: float
    equal_access: float
    safe_access: float
    unsafe_access: float
    reduction: float
    half_interval_95: float
    perfect_radio: float


def run(settings: RakhshanSettings, _case: Case) -> list[VariantLine]:
    """Simulate each variant, with its own labels and with random ones."""
    return [
        _line(settings, variant, shuffled=shuffled)
        for variant in VARIANTS
        for shuffled in (False, True)
    ]


def _line(settings: RakhshanSettings, variant: str, *, shuffled: bool) -> VariantLine:
    highway = settings.highway.model_copy(update=VARIANTS[variant])
    changed = settings.model_copy(update={"highway": highway})
    outcome = simulate(changed, shuffled=shuffled)
    found = gain(changed, outcome)
    return VariantLine(
        variant=variant,
        labels="random" if shuffled else "by probability",
        unsafe_share=outcome.unsafe_share,
        without_radio=float(outcome.without_radio.mean()),
        least_with_equal_access=float(outcome.equal.mean(axis=-1).min()),
        equal_access=found.equal_access,
        safe_access=found.safe_access,
        unsafe_access=found.unsafe_access,
        reduction=found.reduction,
        half_interval_95=found.error,
        perfect_radio=found.perfect_radio,
    )


def table(_settings: RakhshanSettings, rows: Sequence[list[VariantLine]]) -> list[VariantLine]:
    """The lines of the only run."""
    return rows[0]


def summary(results: Results[RakhshanSettings, list[VariantLine], VariantLine]) -> str:
    """The reduction of each variant, one a line."""
    return "\n".join(
        f"{line.variant:24} {line.labels:10} {line.reduction:7.2%} +- {line.half_interval_95:.2%};"
        f" radio without delay {line.perfect_radio:.2%}"
        for line in results.table
    )


STUDY = Study(
    name="rakhshan-sensitivity",
    sentence="What driver-based access gains if one thing is changed that the paper leaves open.",
    settings=RakhshanSettings,
    default=BROAD,
    takes_settings=False,
    about_s=lambda _: 110.0,
    case=Case,
    run=run,
    table=table,
    line=VariantLine,
    summary=summary,
)
