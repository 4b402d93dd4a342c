"""IDs of a lead's texts are derived one after the other."""

from onboard.observations import Lead, LeadIdentity, PlateCandidate
from sim_rig.cars.derivation_delay import DERIVING_S, DerivationDelay


def lead(*texts: str, certain: str | None = None, probability: float = 0.1) -> Lead:
    identity = LeadIdentity.UNKNOWN if certain is None else LeadIdentity.KNOWN
    candidates = tuple(PlateCandidate(text, probability) for text in texts)
    return Lead(0.0, identity, text=certain, gap_m=20.0, track_id=1, candidates=candidates)


def texts_of(seen: Lead) -> list[str]:
    return [each.text for each in seen.candidates]


def test_the_likeliest_text_is_derived_first_and_each_takes_its_time() -> None:
    delay = DerivationDelay()
    seen = lead("AB1", "AB2", "AB3")
    assert texts_of(delay.derived(seen, 5.0)) == []
    assert texts_of(delay.derived(seen, 5.0 + 1.5 * DERIVING_S)) == ["AB1"]
    assert texts_of(delay.derived(seen, 5.0 + 2.5 * DERIVING_S)) == ["AB1", "AB2"]
    assert texts_of(delay.derived(seen, 9.0)) == ["AB1", "AB2", "AB3"]
    assert texts_of(delay.derived(lead("AB4", "AB2"), 9.0)) == ["AB2"]
    assert texts_of(delay.derived(lead("AB5"), 9.0 + 1.5 * DERIVING_S)) == []  # AB4 was


def test_a_certain_text_is_there_at_once_and_an_unlikely_one_never() -> None:
    delay = DerivationDelay()
    assert texts_of(delay.derived(lead("AB1", certain="AB1"), 0.0)) == ["AB1"]
    unlikely = lead("AB2", probability=1e-5)
    delay.derived(unlikely, 0.0)
    assert texts_of(delay.derived(unlikely, 1.0)) == []


def test_at_the_start_of_an_epoch_each_text_takes_twice_as_long() -> None:
    delay = DerivationDelay()
    seen = lead("AB1", "AB2")
    delay.derived(seen, 5.0, ids_of_each=2)
    assert texts_of(delay.derived(seen, 5.0 + 1.5 * DERIVING_S, ids_of_each=2)) == []
    assert texts_of(delay.derived(seen, 5.0 + 2.5 * DERIVING_S, ids_of_each=2)) == ["AB1"]
