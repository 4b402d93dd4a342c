"""The studies by name: each is a file `PACKAGE/NAME_study.py`, imported when it is used."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from onboard.errors import UserError

if TYPE_CHECKING:
    from onboard.settings import Settings
    from sim_rig.studies.campaigns.campaign import Workers
    from sim_rig.studies.campaigns.study import AnyStudy

STUDIES = Path(__file__).parents[1]
_END = "_study.py"


def study_files() -> dict[str, Path]:
    """The file of each study by its name, sorted; none is imported."""
    files = STUDIES.glob(f"*/*{_END}")
    return dict(sorted((file.name.removesuffix(_END).replace("_", "-"), file) for file in files))


def study_names() -> list[str]:
    """Names of all studies."""
    return list(study_files())


def check_study(name: str) -> None:
    """Check that a study has this name.

    Raises:
        UserError: no study has it.
    """
    if name not in study_names():
        raise UserError(f"no study {name!r}; there are: {', '.join(study_names())}")


def check_studies(names: Sequence[str]) -> None:
    """Check that each of these names a study.

    Raises:
        UserError: one does not; if it is a setting of one before it, the error says how to give it.
    """
    for at, name in enumerate(names):
        for study in names[:at] if name not in study_names() else ():
            if name in setting_names(study):
                raise UserError(f"{name} is a setting of {study}: write --{name} VALUE")
        check_study(name)


def find_study(name: str) -> "AnyStudy":
    """Import one study.

    Raises:
        UserError: no study has this name.
    """
    check_study(name)
    file = study_files()[name]
    study: AnyStudy = import_module(f"sim_rig.studies.{file.parent.name}.{file.stem}").STUDY
    return study


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
    from sim_rig.studies.campaigns.lists_of_one import with_lists_of_one  # noqa: PLC0415 (see above)

    study = find_study(name)
    if not study.takes_settings and (settings is not None or given):
        raise UserError(f"the study {name} takes no settings")
    chosen = None if settings is None else load_settings(settings, study.settings)
    if given:
        tree = {} if chosen is None else chosen.model_dump(mode="json")
        listed = with_lists_of_one(tree | dict(given), study.settings)
        chosen = parse_settings(listed, study.settings, name)
    return study.write(out_dir, chosen, workers)


def settings_schema(name: str) -> "type[Settings] | None":
    """Import the settings of a study; `None` if it takes none.

    Raises:
        UserError: no study has this name.
    """
    study = find_study(name)
    return study.settings if study.takes_settings else None


def setting_names(name: str) -> list[str]:
    """The names of a study's settings.

    Raises:
        UserError: no study has this name.
    """
    schema = settings_schema(name)
    return [] if schema is None else list(schema.model_fields)


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
