"""Render, train and export one network: `python -m training reader` or `detector`."""

import argparse
import logging
import os
from pathlib import Path

import torch

from onboard.vision.plate_detector import CORNERS_MODEL
from onboard.vision.plate_reader import DEFAULT_MODEL as DEFAULT_READER
from training.settings import SETTINGS_FILE, load_training_settings
from training.train_detector import train_detector
from training.train_reader import train_reader

MODELS = DEFAULT_READER.parent


def main() -> None:
    """One network, by its settings."""
    parser = argparse.ArgumentParser(prog="python -m training", description=__doc__)
    parser.add_argument("network", choices=["reader", "detector"])
    parser.add_argument(
        "--folder",
        type=Path,
        default=Path("build/training"),
        help="rendered pictures are kept here, and used again if they are there",
    )
    parser.add_argument("--settings", type=Path, default=SETTINGS_FILE)
    parser.add_argument(
        "--models",
        type=Path,
        default=MODELS,
        help="where the network is written (default: %(default)s)",
    )
    parser.add_argument(
        "--processes", type=int, default=os.cpu_count(), help="to render with (default: all cores)"
    )
    arguments = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    torch.set_num_threads(1)  # so that sums are made in the same order everywhere
    settings = load_training_settings(arguments.settings)
    folder = arguments.folder / arguments.network
    if arguments.network == "reader":
        model = arguments.models / DEFAULT_READER.name
        train_reader(settings.reader, folder, model, arguments.processes)
    else:
        model = arguments.models / CORNERS_MODEL.name
        train_detector(settings.detector, folder, model, arguments.processes)


if __name__ == "__main__":
    main()
