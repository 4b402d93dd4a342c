"""How soon the lead of a close row is identified: `python -m tests.lcca.identification_times`.

One of 24 cars follows the one ahead by 10 to 15 m, sees it by the rig's camera model, and receives
all others, whose speeds change one after the other. Of its cores `Identification` runs alone.
"""

import math
import sys

import numpy as np

from onboard.lcca.events import TrackedLead
from onboard.lcca.identification import Identification
from onboard.messages.lcca import NAME_BYTES, Answer, Inquiry
from onboard.observations import Lead
from onboard.vision.settings import VisionSettings
from sim_rig.cars.camera_model import CameraModel
from sim_rig.cars.camera_view import FPS, calibration
from sim_rig.cars.derivation_delay import DerivationDelay
from sim_rig.rendering.plate_texts import text_of
from sim_rig.rendering.scene import SceneCar
from sim_rig.studies.lcca.platoon_sight import LENSES, ClearView
from sim_rig.studies.lcca.study_lcca import car_id_of

CARS, SPEED_M_S, GAPS_M, LOSS = 24, 15.0, (10.0, 15.0), 0.1
SWAY_M_S, SWAY_S, LAG_S = 1.0, 20.0, 0.6
"""By which speeds change, in which time, and by how much later behind."""
SPEEDOMETERS = 1.004, 1.012
BSM_S, LONGEST_S = 0.1, 30.0
RUNS = 2300


class _Row:
    """The cars, of which one looks ahead."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        plates = [text_of("LL###LL", rng).replace(" ", "") for _ in range(CARS)]
        self.host = int(rng.integers(1, CARS))
        self._gap_m = float(rng.uniform(*GAPS_M))
        self.ids = [car_id_of(plate) for plate in plates]
        self.others = [car for car in range(CARS) if car != self.host]
        self._by_name = {self.ids[car][:NAME_BYTES]: car for car in self.others}
        self._by_name |= {sender(car): car for car in self.others}
        self._scales = rng.uniform(*SPEEDOMETERS, CARS)
        self._phase = rng.uniform(0.0, math.tau)
        self.plate = plates[self.host - 1]

    def gap_m(self, now: float) -> float:
        """To the lead."""
        changes_m = [self._swayed_m(car, now) - self._swayed_m(car, 0.0) for car in self._pair]
        return self._gap_m + changes_m[0] - changes_m[1]

    def shown_m_s(self, car: int, now: float) -> float:
        """Speed as OBD gives it."""
        speed_m_s = SPEED_M_S + SWAY_M_S * math.sin(self._angle(car, now))
        return round(float(self._scales[car]) * speed_m_s * 3.6) / 3.6

    def answering(self, inquiry: Inquiry) -> list[int]:
        """Who bears one of the names, unless inquiry or answer is lost."""
        asked = {self._by_name[name] for name in inquiry.names if name in self._by_name}
        return [car for car in sorted(asked) if self.is_received() and self.is_received()]

    def is_received(self) -> bool:
        """Whether a message is not lost."""
        return float(self._rng.random()) >= LOSS

    @property
    def _pair(self) -> tuple[int, int]:
        return self.host - 1, self.host

    def _swayed_m(self, car: int, now: float) -> float:
        return -SWAY_M_S * SWAY_S / math.tau * math.cos(self._angle(car, now))

    def _angle(self, car: int, now: float) -> float:
        return math.tau * (now - LAG_S * car) / SWAY_S + self._phase


def sender(car: int) -> bytes:
    """Temporary ID of a car."""
    return b"v" + car.to_bytes(3)


def identified_after_s(seed: int) -> float:
    """Time from the first image of the lead; infinite if another car is taken for it, or none."""
    rng = np.random.default_rng([seed, 77])
    row = _Row(rng)
    view = ClearView(lambda at_s: [("ahead", SceneCar(row.gap_m(at_s), plate=row.plate))])
    phase_s = float(rng.uniform(0.0, 1.0 / FPS))
    camera = CameraModel(view, VisionSettings(), phase_s, rng, calibration(LENSES["rig"]))
    core = Identification(row.ids[row.host], sender(row.host), rng)
    derivation, bsm_at, began_at = DerivationDelay(), 0.0, math.inf
    while (now := camera.get_timer()) <= LONGEST_S:
        core.receive_speed(row.shown_m_s(row.host, now), now)
        if now >= bsm_at:
            bsm_at = now + BSM_S
            for car in filter(lambda _: row.is_received(), row.others):
                core.receive_speed_on_air(sender(car), sender(car), row.shown_m_s(car, now), now)
        camera.handle_timer(now)
        leads = [each for each in iter(camera.next_event, None) if isinstance(each, Lead)]
        lead = TrackedLead.of(derivation.derived(leads[-1], now), car_id_of)
        began_at = now if lead is not None and math.isinf(began_at) else began_at
        core.receive_lead(lead, now)
        for message in core.messages_to_send():
            assert isinstance(message, Inquiry)
            for car in row.answering(message):
                speed_m_s = row.shown_m_s(car, now)
                answer = Answer(
                    row.ids[car], message.sender_id, message.sequence, sender(car), speed_m_s
                )
                core.receive_message(answer, None, now + 0.005)
        if core.identity is not None:
            is_right = core.identity.car_id == row.ids[row.host - 1]
            return now - began_at if is_right else math.inf
    return math.inf


def main(runs: int = RUNS) -> None:
    """Print the distribution."""
    times_s = [identified_after_s(seed) for seed in range(runs)]
    shares = 0.5, 0.9, 0.99, 0.999, 1.0
    found_s = np.quantile(times_s, shares, method="lower")
    worst = sorted(range(runs), key=times_s.__getitem__)[-8:]
    sys.stdout.write(f"{dict(zip(shares, found_s.round(1).tolist(), strict=True))}\n")
    sys.stdout.write(f"{ {seed: round(times_s[seed], 1) for seed in worst} }\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
