"""The outcome of several runs."""

from itertools import permutations

from sim_rig.reporting.verdict import Outcome, worst


def test_a_run_that_could_not_be_judged_hides_no_failure() -> None:
    for outcomes in permutations(Outcome):
        assert worst(outcomes) is Outcome.FAILED
    assert worst([Outcome.INVALID, Outcome.PASSED]) is Outcome.INVALID
    assert worst([Outcome.PASSED, Outcome.PASSED]) is Outcome.PASSED
