"""Sentences of the pages with figures that also stand in code: they are made from the code's.

Where a page names the constant, `test_numbers.py` compares them; here are the sentences for users.
"""

import csv
import math
import re

import pytest

from onboard.access.adaptation import SAFE_BELOW, UNSAFE_ABOVE, UNSAFE_INTERVAL_S
from onboard.brake_request.brake_requester import VALIDITY_S
from onboard.bsm_transmission.schedule import (
    DENSITY_COEFFICIENT,
    MAXIMUM_INTERVAL_S,
    MINIMUM_INTERVAL_S,
)
from onboard.gnss import gpsd
from onboard.gnss.settings import GnssSettings
from onboard.hmi.group_view import MEMBER_S
from onboard.hmi.settings import HmiSettings
from onboard.lcca.identification import ASK_HEADWAY_S, BELIEF, MAX_ANSWERS
from onboard.lcca.parameters import DEFAULTS as GROUP
from onboard.messages.bsm import FOOTER_REGION
from onboard.misbehaviour.signer_credibility import HALF_LIFE_S, MOST_ALARMS, MOST_ALARMS_OF_UNIT
from onboard.mvs.settings import MvsSettings
from onboard.obd import can_bus
from onboard.recorder.black_box import FLUSH_S, QUEUE_RECORDS, RETRY_S, STOP_S
from onboard.risk.settings import FcwSettings
from onboard.security.security_services import CLOCK_TOLERANCE_S, MESSAGE_LIFETIME_S
from onboard.tracking.track_merging import MAX_REPORTED_SIGMA_M
from onboard.tracking.tracks import DEFAULTS as TRACKING
from onboard.vision.live_frames import RECONNECT_S
from onboard.vision.parameters import DEFAULT_PARAMETERS
from onboard.vision.plate_posterior import MAX_CANDIDATES
from onboard.vision.plate_reader import CERTAIN
from onboard.vision.plates import MIN_PX
from onboard.vision.tracker import KEEP_S
from onboard.wave_udp import psid
from onboard.wave_udp.wsmp import ETHERTYPE
from sim_rig.run_log.lateness import LIMITS_S
from tests.docs.test_pages import ROOT

UNIT_FILE = (ROOT / "deploy/files/onboard.service").read_text(encoding="utf-8")
PAGE_SCRIPT = (ROOT / "onboard/hmi/page/link.js").read_text(encoding="utf-8")
NUMBERS = {3: "three"}


def in_unit(key: str) -> str:
    """A value of the service's unit."""
    (found,) = re.findall(rf"(?m)^{key}=(\S+)$", UNIT_FILE)
    return str(found)


def in_page_script(name: str) -> float:
    (found,) = re.findall(rf"(?m)^const {name} = (\d+);", PAGE_SCRIPT)
    return float(found)


SENTENCES = {
    "docs/in-the-car.md": [
        f"Signatures need it right within {CLOCK_TOLERANCE_S:g} s",
        f"must stop braking {VALIDITY_S} s after the last request",
        f"The bus is opened again every {can_bus.RECONNECT_PERIOD_S} s",
        f"gpsd every {gpsd.RECONNECT_PERIOD_S:g} s",
        f"opened again at least every {RECONNECT_S[1]:g} s",
        f"leaves its group after {GROUP.membership_lifetime_s} s",
        f"starts it again after 0.{in_unit('RestartSec').removesuffix('00ms')} s",
        f"watchdog ends it after {in_unit('WatchdogSec')} s",
        f"tried again every {RETRY_S:g} s",
        f"{in_unit('MemoryMax').removesuffix('M')} MiB of memory",
    ],
    "docs/pages.md": [
        f"port: {HmiSettings.model_fields['port'].default}",
        f"heard in the last {MEMBER_S:g} s",
        f"**Without data** for {in_page_script('STALE_MS') / 1e3:g} s",
    ],
    "docs/lcca.md": [
        f"headway of {GROUP.join_headway_s} s",
        f"up to {MAX_CANDIDATES} texts",
        f"probability of {BELIEF} or more",
        f"asked for from a headway of {ASK_HEADWAY_S:g} s on",
        f"{GROUP.lead_hold_s} s after the last frame",
        f"that shows a headway below {GROUP.leave_headway_s} s",
        f"without any news of the braking after {GROUP.event_lifetime_s:g} s",
        f"stops sending: after {GROUP.membership_lifetime_s} s",
        f"but no replies: after {GROUP.leader_silence_s} s",
        f"or no joins: after {GROUP.join_lifetime_s} s",
        f"a warning older than {GROUP.event_lifetime_s:g} s",
        f"after those of {MAX_ANSWERS} vehicles",
    ],
    "docs/risk.md": [
        f"needed after a reaction time of {FcwSettings.model_fields['reaction_s'].default} s",
    ],
    "docs/mvs.md": [
        f"after {TRACKING.unseen_s} s without a measurement",
        f"position exceeds {MAX_REPORTED_SIGMA_M:g} m",
        f"M = {MvsSettings.model_fields['max_entries'].default} entries of a footer",
        f"under PSID 0x{psid.SENSOR_SHARING:x}",
        f"TCP port {GnssSettings.model_fields['port'].default}",
        f"raises {NUMBERS[MOST_ALARMS]} false alarms at most",
    ],
    "docs/vision.md": [
        f"certain from {CERTAIN} on",
        f"up to {MAX_CANDIDATES} texts",
        f"more than {KEEP_S} s apart have no lead",
        f"repeats for {DEFAULT_PARAMETERS.frozen_after_s} s",
        f"narrower than {MIN_PX:g} px",
    ],
    "docs/plates.md": [f"confidence of at least {CERTAIN}"],
    "docs/black-box.md": [
        f"all but the last {FLUSH_S} s",
        f"waits for it at most {STOP_S} s",
        f"until {QUEUE_RECORDS:,} records are waiting",
        f"tried again every {RETRY_S:g} s",
    ],
    "docs/faults.md": [
        f"{CLOCK_TOLERANCE_S:g} s ahead (`CLOCK_TOLERANCE_S`)",
        f"{MESSAGE_LIFETIME_S:g} s behind (`MESSAGE_LIFETIME_S`)",
    ],
    "docs/paper-access.md": [
        f"Above {UNSAFE_ABOVE} the vehicle is *unsafe*",
        f"sends its BSM every {UNSAFE_INTERVAL_S} s",
        f"Below {SAFE_BELOW} it is *safe*",
    ],
    "docs/design/access.md": [
        f"sets it to {MINIMUM_INTERVAL_S} s, and lengthens it up to {MAXIMUM_INTERVAL_S} s",
        f"more than {DENSITY_COEFFICIENT:g} vehicles",
    ],
    "docs/security.md": [
        f"raise {NUMBERS[MOST_ALARMS]} false alarms in an hour",
        f"[{HALF_LIFE_S * math.log2(MOST_ALARMS / (MOST_ALARMS - 1)) / 60:.0f} minutes]",
        f"a road-side unit {MOST_ALARMS_OF_UNIT}",
    ],
    "docs/wire.md": [
        f"PSID 0x{psid.LCCA:x} (`lcca_psid`)",
        f"0x{psid.SPAT:x}: SPAT, 0x{psid.MAP:x}: MAP; 0x{psid.SENSOR_SHARING:x}: SDSM",
        f"regional extension {FOOTER_REGION} of the BSM",
        f"EtherType 0x{ETHERTYPE:X}",
    ],
}


@pytest.mark.parametrize(
    ("page", "sentence"), [(page, each) for page, found in SENTENCES.items() for each in found]
)
def test_a_page_says_what_the_code_does(page: str, sentence: str) -> None:
    assert sentence in " ".join((ROOT / page).read_text(encoding="utf-8").split())


def table(page: str, name: str) -> list[list[str]]:
    """The rows of all tables that a command has written into a page under a name, as cells."""
    text = (ROOT / page).read_text(encoding="utf-8")
    written = text.partition(f"<!-- {name} -->\n")[2].partition("<!-- end of")[0]
    return [[cell.strip() for cell in row.split("|")[1:-1]] for row in written.splitlines() if row]


def in_readme(what: str) -> list[str]:
    """What was measured, and for comparison, of the row of the README's table that begins so."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (row,) = re.findall(rf"(?m)^\| {re.escape(what)}.*\|$", text)
    return [cell.strip() for cell in row.split("|")[2:-1]]


def test_the_readme_repeats_what_was_measured_on_dashcam_clips() -> None:
    clips = table("docs/vision.md", "clips")[2:]
    seen, found = (sum(int(row[at]) for row in clips) for at in (1, 2))
    ghosts_s = [float(row[5].removesuffix(" s")) for row in clips if row[5] != "none"]

    assert in_readme("labelled frames of dashcam clips")[0] == f"{found} of {seen}"
    assert in_readme("longest time in these clips")[0] == f"{max(ghosts_s):g} s"


def test_the_readme_repeats_what_was_measured_on_rendered_drives() -> None:
    drives = {row[0]: row for row in table("docs/vision.md", "drives") if "px" in row[0]}
    near, middle, far = (drives[f"2000px, {gap_m}m"] for gap_m in (20, 25, 30))
    named = [row[1].partition("/")[0] for row in (near, middle, far)]

    assert in_readme("rendered drives, lens of 2,000 px") == [
        f"{named[0]}, {named[1]} and {named[2]} of 30, by camera and radio",
        f"by the camera alone {near[3]}, {middle[3]} and {far[3]}",
    ]


def test_the_readme_repeats_what_was_measured_on_photographs() -> None:
    rows = table("docs/plates.md", "scores")[2:]
    found, exact = ({(r[0], r[1]): float(r[at].removesuffix("%")) for r in rows} for at in (2, 3))
    regions = [("us (109)", 109), ("eu (50)", 50), ("br (19)", 19)]
    plates = sum(round(found[name, "ours"] * n / 100) for name, n in regions)
    ours = ", ".join(f"{exact[name, 'ours']:g}" for name, _ in regions)
    baseline = ", ".join(f"{exact[name, 'baseline']:.0f}" for name, _ in regions)

    assert in_readme("plates in photographs")[0] == f"{plates} of {sum(n for _, n in regions)}"
    assert in_readme("plates whose whole text") == [
        f"{ours} %",
        f"aim 90 %; OpenCV with Tesseract {baseline} %",
    ]


def test_the_readme_repeats_what_was_measured_of_the_camera() -> None:
    (share,) = (row for row in table("docs/vision.md", "speed") if "at 15 frames" in row[0])
    ours, decoding = (float(cell.removesuffix(" cores")) for cell in share[1:])

    measured, compared = in_readme("share of one core for 15 images a second")
    assert measured == f"{ours:.2f}"
    assert compared.startswith(f"decoding alone {decoding:.2f}")


def test_the_readme_repeats_how_often_another_vehicle_is_taken_for_the_lead() -> None:
    with (ROOT / "docs/tables/false-identity.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["insider"] == "none"]
    changes, wrong = (
        sum(int(r[key]) for r in rows) for key in ("changes", "wrong_longer_than_1_s")
    )

    assert in_readme("changes of the lead")[0] == f"{wrong} of {changes:,}"


def test_the_wires_of_the_bench_have_the_limits_of_a_run() -> None:
    with (ROOT / "docs/tables/bench-wires.csv").open(encoding="utf-8") as file:
        limits_s = {row["what"]: float(row["limit_ms"]) / 1e3 for row in csv.DictReader(file)}

    assert limits_s == pytest.approx(LIMITS_S)
