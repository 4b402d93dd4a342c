"""The dashboard queries only metrics that a vehicle has."""

import json
import re
from pathlib import Path

import yaml

from onboard.hmi.metrics import Metrics
from onboard.hmi.settings import HmiSettings
from onboard.observations import Sensor
from onboard.recorder.build import Build

FOLDER = Path(__file__).parents[2] / "deploy" / "grafana"
BUILD = Build("0.2.0", "4f463bb4b", "20261124")

DASHBOARD = json.loads((FOLDER / "onboard.json").read_text())


def metric_names() -> set[str]:
    """Return the names of all metrics of a vehicle without events."""
    metrics = Metrics(frozenset(Sensor), BUILD)
    text = metrics.exposition()[0].decode()
    families = re.findall(r"^# TYPE (\w+) (\w+)$", text, re.MULTILINE)
    names = {name for name, _ in families}
    return names | {f"{name}_bucket" for name, kind in families if kind == "histogram"}


def test_every_metric_of_the_dashboard_exists() -> None:
    names = metric_names()
    for panel in DASHBOARD["panels"]:
        for target in panel["targets"]:
            queried = re.findall(r"\b((?:onboard|process)_\w+)", target["expr"])
            assert queried, panel["title"]
            for name in queried:
                assert name in names, panel["title"]


def test_panels_do_not_overlap() -> None:
    cells = [
        (panel["gridPos"]["x"] + x, panel["gridPos"]["y"] + y)
        for panel in DASHBOARD["panels"]
        for x in range(panel["gridPos"]["w"])
        for y in range(panel["gridPos"]["h"])
    ]

    assert len(cells) == len(set(cells))
    assert max(x for x, _ in cells) < 24
    ids = [panel["id"] for panel in DASHBOARD["panels"]]
    assert len(ids) == len(set(ids))


def test_prometheus_reads_the_default_port_of_a_vehicle() -> None:
    settings = yaml.safe_load((FOLDER / "prometheus.yaml").read_text())

    (job,) = settings["scrape_configs"]
    assert job["static_configs"] == [{"targets": [f"127.0.0.1:{HmiSettings().port}"]}]
