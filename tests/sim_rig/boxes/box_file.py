"""The file of a box without commands."""

from onboard.settings import parse_settings
from sim_rig.boxes.settings import BoxSettings

RIG = {
    "plate": "RD288HX",
    "bus": {"port": 29536},
    "camera": {"port": 8090},
    "radio": {"port": 5398, "box_port": 5399},
    "keys": "trial",
    "recording": "drive",
}


def box(**more: object) -> BoxSettings:
    return parse_settings(RIG | more, BoxSettings, "red.yaml")
