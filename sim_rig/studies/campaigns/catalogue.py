"""The studies by name; each is imported only when it is run."""

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from onboard.errors import UserError

if TYPE_CHECKING:
    from onboard.settings import Settings
    from sim_rig.studies.campaigns.campaign import Workers

Study = Callable[[Path], str]
"""Writes table, figure and settings into a folder; returns a summary."""

_SINGLE = {
    "joerer": "joerer.approaches:run",
    "rakhshan-figure6": "rakhshan.drivers:figure6",
    "rakhshan-figure7": "rakhshan.drivers:figure7",
    "rakhshan-figure9": "rakhshan.figures:figure9",
    "rakhshan-figure10": "rakhshan.figures:figure10",
    "rakhshan-figure11": "rakhshan.figures:figure11",
    "rakhshan-sensitivity": "rakhshan.figures:sensitivity",
    "rakhshan-table1": "rakhshan.tables:table1",
    "rakhshan-table2": "rakhshan.tables:table2",
}
"""Studies without settings."""

_CAMPAIGNS = {
    "attacks": "attacks.attacks:run:AttacksSettings",
    "crossing-alarms": "alarms.crossing_alarms:run:AlarmSettings",
    "false-identity": "lcca.false_identity:run:FalseIdentitySettings",
    "faults": "faults.faults:run:FaultsSettings",
    "following-alarms": "alarms.following_alarms:run:FollowingSettings",
    "inquiry-load": "lcca.inquiry_load:run:InquiryLoadSettings",
    "joerer-channel": "joerer.channel:run:JoererChannelSettings",
    "lcca-chain": "lcca.chain:chain:ChainSettings",
    "linker": "attacks.linker:run:LinkerSettings",
    "mvs-ablation": "mvs.ablation:run:AblationSettings",
    "mvs-figure3": "mvs.collisions:figure3:Figure3Settings",
    "mvs-figure9": "mvs.collisions:figure9:CollisionSettings",
    "platoons": "lcca.platoons:run:PlatoonSettings",
    "soak": "soak.soak:run:SoakSettings",
    "mvs-figure8": "mvs.sharing:figure8:SharingSettings",
    "mvs-table1": "mvs.sharing:table1:Table1Settings",
    "radio": "radio.ns3_validation:run:RadioSettings",
    "rakhshan-csma": "rakhshan.csma:run:RakhshanCsmaSettings",
    "rakhshan-readings": "rakhshan.readings:run:ReadingsSettings",
}
"""Studies of many runs, which take settings and workers."""


def study_names() -> list[str]:
    """Names of all studies."""
    return sorted(_SINGLE | _CAMPAIGNS)


def run_study(
    name: str,
    out_dir: Path,
    settings: Path | None,
    workers: "Workers",
    given: Mapping[str, object] | None = None,
) -> str:
    """Run one study.

    Args:
        name: of the study.
        out_dir: folder of its results.
        settings: file of its settings; the default ones if None.
        workers: processes or cluster, for studies of many runs.
        given: single settings by name, which override those of the file.

    Returns:
        A summary of the results.

    Raises:
        UserError: no study has this name, or the settings are invalid.
    """
    from onboard.settings import load_settings, parse_settings  # noqa: PLC0415 (names need none)

    if name not in _CAMPAIGNS:
        if name in _SINGLE and (settings is not None or given):
            raise UserError(f"the study {name} takes no settings")
        return find_study(name)(out_dir)
    module, function, schema = _CAMPAIGNS[name].split(":")
    study_module = import_module(f"sim_rig.studies.{module}")
    schema_of = getattr(study_module, schema)
    chosen = None if settings is None else load_settings(settings, schema_of)
    if given:
        tree = {} if chosen is None else chosen.model_dump(mode="json")
        chosen = parse_settings(tree | dict(given), schema_of, name)
    summary: str = getattr(study_module, function)(out_dir, chosen, workers)
    return summary


def settings_schema(name: str) -> "type[Settings] | None":
    """Import the settings of a study; `None` if it takes none.

    Raises:
        UserError: no study has this name.
    """
    check_study(name)
    if name in _SINGLE:
        return None
    module, _, schema = _CAMPAIGNS[name].split(":")
    found: type[Settings] = getattr(import_module(f"sim_rig.studies.{module}"), schema)
    return found


def study_settings(name: str) -> str:
    """Describe the settings of a study, with their defaults, as a YAML file.

    Raises:
        UserError: no study has this name.
    """
    from sim_rig.studies.campaigns.settings_help import settings_as_yaml  # noqa: PLC0415 (see above)

    schema = settings_schema(name)
    if schema is None:
        return f"# {name} takes no settings"
    return f"# Settings of {name}, for --settings FILE\n{settings_as_yaml(schema)}"


def check_study(name: str) -> None:
    """Check that a study has this name.

    Raises:
        UserError: no study has it.
    """
    if name not in _SINGLE and name not in _CAMPAIGNS:
        raise _unknown(name)


def find_study(name: str) -> Study:
    """Import one study.

    Raises:
        UserError: no study has this name.
    """
    location = _SINGLE.get(name)
    if location is None:
        raise _unknown(name)
    module, function = location.split(":")
    study: Study = getattr(import_module(f"sim_rig.studies.{module}"), function)
    return study


def _unknown(name: str) -> UserError:
    return UserError(f"no study {name!r}; there are: {', '.join(study_names())}")
