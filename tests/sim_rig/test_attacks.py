"""The study of attacks: two insiders cost six false alarms at most, and true ones are heard."""

from pathlib import Path

from sim_rig.studies.attacks import AttackKind, AttacksSettings, run
from sim_rig.studies.campaign import Workers

FEW = AttacksSettings(attacks=(AttackKind.BSM,), insiders=(2,), seconds=40.0)


def test_the_table_tells_false_and_missed_alarms_with_and_without_checks(tmp_path: Path) -> None:
    summary = run(tmp_path, FEW, Workers())

    assert summary == "at most 3.0 false alarms an insider; 0 of 2 true vehicles missed"
    _, unchecked, checked = (tmp_path / "table.csv").read_text().splitlines()
    assert unchecked.startswith('"crossing vehicle, by BSM",1,False,40,')
    assert checked.startswith('"crossing vehicle, by BSM",2,True,40,6,')
    assert checked.endswith(",2,2,0")
