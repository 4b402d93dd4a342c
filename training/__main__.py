"""Render, train and export one network: `python -m training reader`, `detector` or `vehicles`."""

import argparse
import logging
import os
from pathlib import Path

import torch

from onboard.vision.plate_detector import CORNERS_MODEL
from onboard.vision.plate_reader import DEFAULT_MODEL as DEFAULT_READER
from onboard.vision.vehicle_network import DEFAULT_MODEL as VEHICLE_MODEL
from training.settings import SETTINGS_FILE, load_training_settings
from training.train_detector import train_detector
from training.train_reader import train_reader
from training.train_vehicle_detector import train_vehicle_detector

MODELS = DEFAULT_READER.parent


def main() -> None:
    """Train one network."""
    parser = argparse.ArgumentParser(prog="python -m training", description=__doc__)
    parser.add_argument("network", choices=["reader", "detector", "vehicles"])
    parser.add_argument(
        "--folder",
        type=Path,
        default=Path("build/training"),
        help="folder of rendered images, which are reused if they exist",
    )
    parser.add_argument("--settings", type=Path, default=SETTINGS_FILE)
    parser.add_argument(
        "--models",
        type=Path,
        default=MODELS,
        help="folder for the network (default: %(default)s)",
    )
    parser.add_argument(
        "--processes", type=int, default=os.cpu_count(), help="for rendering (default: all cores)"
    )
    arguments = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    torch.set_num_threads(1)  # for the same order of sums everywhere
    settings = load_training_settings(arguments.settings)
    folder = arguments.folder / arguments.network
    if arguments.network == "reader":
        model = arguments.models / DEFAULT_READER.name
        train_reader(settings.reader, folder, model, arguments.processes)
    elif arguments.network == "vehicles":
        model = arguments.models / VEHICLE_MODEL.name
        train_vehicle_detector(settings.vehicles, folder, model, arguments.processes)
    else:
        model = arguments.models / CORNERS_MODEL.name
        train_detector(settings.detector, folder, model, arguments.processes)


if __name__ == "__main__":
    main()
