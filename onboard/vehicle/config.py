"""Configuration of a vehicle: one YAML file, with a section for each package's settings."""

import math
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, ClassVar

from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from onboard.access.settings import AccessSettings
from onboard.brake_request.settings import BrakeRequestSettings
from onboard.detector.settings import DetectorSettings
from onboard.gnss.settings import GnssSettings
from onboard.hmi.settings import HmiSettings
from onboard.interface.settings import InterfaceSettings
from onboard.its_g5 import ports
from onboard.lcca.settings import LccaSettings
from onboard.mvs.settings import MvsSettings, SharedIn
from onboard.obd.settings import DEFAULT_CHANNEL, CanSettings, ObdSettings
from onboard.observations import Sensor
from onboard.recorder.settings import RecorderSettings
from onboard.risk.settings import RiskSettings
from onboard.security.settings import SecuritySettings
from onboard.settings import Settings
from onboard.vision.settings import CameraSettings, VisionSettings
from onboard.wave_udp import psid
from onboard.wave_udp.settings import RadioProfile, RadioSettings

_PLATE = re.compile(r"[A-Z0-9]{1,10}")


def _as_a_camera_reads_it(plate: str) -> str:
    if not _PLATE.fullmatch(plate):
        read = re.sub(r"[^A-Z0-9]", "", plate.upper())
        example = f", as {read}" if _PLATE.fullmatch(read) else ""
        raise ValueError(
            f"is written in 1 to 10 upper case letters and digits, without separators{example}"
        )
    return plate


PlateText = Annotated[str, AfterValidator(_as_a_camera_reads_it)]
"""As a camera reads it: upper case, no separators."""


class CarSettings(Settings):
    """The vehicle itself."""

    plate: PlateText
    """Its number plate, or `TAG<n>` for a model vehicle with AR tag n."""
    length_m: float = Field(4.5, gt=0.0, lt=30.0)
    """Bumper to bumper."""
    width_m: float = Field(1.8, gt=0.0, lt=5.0)
    """Without mirrors."""


class SensorTimeoutSettings(Settings):
    """Silence after which a sensor is shown as lost."""

    speed_s: float = Field(0.8, gt=0.0, le=10.0)
    camera_s: float = Field(0.8, gt=0.0, le=10.0)
    position_s: float = Field(3.0, gt=0.0, le=60.0)
    detector_s: float = Field(1.0, gt=0.0, le=10.0)

    def limits_s(self, sensors: Iterable[Sensor]) -> dict[Sensor, float]:
        """Return the timeout of each of `sensors`; `math.inf` for the radio."""
        limits_s = {
            Sensor.SPEED: self.speed_s,
            Sensor.CAMERA: self.camera_s,
            Sensor.POSITION: self.position_s,
            Sensor.DETECTOR: self.detector_s,
            Sensor.RADIO: math.inf,  # no vehicle with a radio need be near
        }
        # A fixed order, so that a replay reports two sensors lost at once in the same order.
        given = frozenset(sensors)
        return {sensor: limit_s for sensor, limit_s in limits_s.items() if sensor in given}


class TraceSettings(Settings):
    """Files for inputs and decisions."""

    file: Path | None = None
    """Trace as JSON lines; `None` writes none."""
    capture: Path | None = None
    """All WSMs sent and received, as pcap for Wireshark; `None` writes none."""


class CarConfig(Settings):
    """The whole configuration. Without its section, a sensor, the radio or the page is not used."""

    elsewhere: ClassVar[Mapping[str, str]] = {
        "cars": "is a scenario of the rig, not the configuration of a car: sim-rig run"
    }

    seed: int | None = Field(None, ge=0)
    """Seed of all random numbers, including temporary IDs; for tests only, and a different one for
    each vehicle. `None` takes it from the operating system."""
    car: CarSettings
    can: CanSettings | None = None
    obd: ObdSettings = ObdSettings()
    camera: CameraSettings | None = None
    vision: VisionSettings = VisionSettings()
    detector: DetectorSettings | None = None
    """A detector of the user's, which sees vehicles on every side."""
    gnss: GnssSettings | None = None
    radio: RadioSettings | None = None
    security: SecuritySettings = SecuritySettings()
    lcca: LccaSettings = LccaSettings()
    lcca_psid: int = Field(psid.LCCA, ge=0, le=psid.HIGHEST)
    """PSID of the group messages; equal in all vehicles of a trial."""
    mvs: MvsSettings = MvsSettings()
    risk: RiskSettings = RiskSettings()
    brake_request: BrakeRequestSettings | None = None
    """Requests to brake, for the controller of a test vehicle; by default there are none."""
    access: AccessSettings = AccessSettings()
    beacons: bool = True
    """Send BSMs, ten a second, as SAE J2945/1 requires."""
    sensor_timeouts: SensorTimeoutSettings = SensorTimeoutSettings()
    hmi: HmiSettings | None = None
    """The driver's page and `/metrics`; nothing is served if it is left out."""
    interface: InterfaceSettings | None = None
    """Events for other programs on this computer, and what they may send."""
    trace: TraceSettings = TraceSettings()
    recorder: RecorderSettings | None = None

    @property
    def psids(self) -> frozenset[int]:
        """Services in which it sends."""
        of_programs = frozenset(self.ports_of_programs)
        if self.radio_profile is RadioProfile.ITS_G5:
            return of_programs | {self.lcca_psid, psid.CAM, psid.DENM, psid.CPM}
        shares_in_sdsm = self.mvs.shared_in is not SharedIn.FOOTER
        return (
            of_programs
            | {self.lcca_psid, psid.BSM}
            | ({psid.SENSOR_SHARING} if shares_in_sdsm else set())
        )

    @property
    def ports_of_programs(self) -> dict[int, int]:
        """BTP ports by the services in which other programs send; 0 with WSMP, which has none."""
        sends = () if self.interface is None else self.interface.sends
        return {each.psid: each.btp_port or 0 for each in sends}

    @property
    def radio_profile(self) -> RadioProfile:
        """Messages and headers; WAVE's without a radio."""
        return RadioProfile.WAVE if self.radio is None else self.radio.profile

    @field_validator("lcca_psid")
    @classmethod
    def _is_not_of_j2735(cls, lcca_psid: int) -> int:
        if lcca_psid in psid.J2735:
            raise ValueError(f"0x{lcca_psid:X} is the PSID of J2735 messages")
        return lcca_psid

    @field_validator("mvs")
    @classmethod
    def _shares_in_what_the_profile_has(cls, mvs: MvsSettings, info: ValidationInfo) -> MvsSettings:
        radio = info.data.get("radio")
        is_its_g5 = radio is not None and radio.profile is RadioProfile.ITS_G5
        if is_its_g5 and mvs.shared_in is not SharedIn.FOOTER:
            raise ValueError(
                f"shared_in: {mvs.shared_in} is of SAE J3224; with the profile its-g5, CPMs carry"
                " what is shared: leave it out"
            )
        return mvs

    @field_validator("brake_request")
    @classmethod
    def _keeps_off_the_obd_port(
        cls, brake_request: BrakeRequestSettings | None, info: ValidationInfo
    ) -> BrakeRequestSettings | None:
        if brake_request is None or brake_request.can is None:
            return brake_request
        channel = brake_request.can.channel
        obd = info.data.get("can")
        if obd is None:
            raise ValueError(f"can.channel {channel}: requires `can`, the OBD port, to keep off it")
        if channel == (obd.channel or DEFAULT_CHANNEL):
            raise ValueError(
                f"can.channel {channel} is the OBD port, which gets no requests to brake; allowed:"
                " a second bus, with another name"
            )
        return brake_request

    @field_validator("interface")
    @classmethod
    def _has_the_detector_of_its_lists(
        cls, interface: InterfaceSettings | None, info: ValidationInfo
    ) -> InterfaceSettings | None:
        accepts = () if interface is None else interface.accepts
        if "object_list" in accepts and info.data.get("detector") is None:
            raise ValueError("accepts object_list: requires the section `detector`")
        return interface

    @field_validator("interface")
    @classmethod
    def _sends_as_the_radio_does(
        cls, interface: InterfaceSettings | None, info: ValidationInfo
    ) -> InterfaceSettings | None:
        radio = info.data.get("radio")
        for each in () if interface is None else interface.sends:
            if radio is None:
                raise ValueError("sends: requires the section `radio`")
            if each.psid == info.data.get("lcca_psid"):
                raise ValueError(f"sends: psid 0x{each.psid:X} is `lcca_psid`")
            if (each.btp_port is None) is (radio.profile is RadioProfile.ITS_G5):
                raise ValueError(
                    f"sends: psid 0x{each.psid:X}: the profile its-g5 needs btp_port, wave has none"
                )
            if each.btp_port in (ports.LCCA, *ports.OF_SERVICES.values()):
                raise ValueError(
                    f"sends: btp_port {each.btp_port} is of the vehicle's own messages"
                )
        return interface

    def sensors(self) -> frozenset[Sensor]:
        """Return the configured sensors, with the radio."""
        sections = {
            Sensor.SPEED: self.can,
            Sensor.CAMERA: self.camera,
            Sensor.POSITION: self.gnss,
            Sensor.RADIO: self.radio,
            Sensor.DETECTOR: self.detector,
        }
        return frozenset(sensor for sensor, section in sections.items() if section is not None)
