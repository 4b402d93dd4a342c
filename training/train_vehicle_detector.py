"""The training run of the vehicle detector, with its export to ONNX."""

import logging
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from onboard.vision.vehicle_network import CELL_PX, SIDE_UNIT_PX, VehicleKind, as_input
from training.networks import VehicleNetwork
from training.rendered_images import rendered
from training.settings import NetworkTrainingSettings
from training.training_loop import train_network
from training.vehicle_scenes import (
    BOTTOM,
    END_LEFT,
    END_RIGHT,
    KIND,
    LEFT,
    RIGHT,
    TOP,
    VIEW_SIZE,
    VISIBLE,
    render_vehicle_scenes,
    viewed,
)

_log = logging.getLogger(__name__)

_INNER, _NEAR = 0.25, 0.5
"""Shares of the box's half extent in which cells (and the nearest one) are labelled as vehicle, and
in which they know its sides."""
_LEAST_VISIBLE = 0.4
"""Share of a vehicle that must be visible; whether one with less is found does not matter."""
_LEAST_WIDTH_PX = 8.0
"""The same for its width."""
_SIDE_WEIGHT, _KIND_WEIGHT = 1.5, 0.2
_CHANNELS = LEFT, TOP, RIGHT, BOTTOM, END_LEFT, END_RIGHT
_VALUES = len(_CHANNELS) + 3

_Targets = tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]


def train_vehicle_detector(
    settings: NetworkTrainingSettings, folder: Path, model: Path, processes: int
) -> None:
    """Render, train, export and validate.

    Args:
        settings: of the run.
        folder: for images and the saved state.
        model: ONNX file to write.
        processes: to render with.
    """
    seed = settings.seed
    scenes, vehicles = rendered(
        folder / "train", render_vehicle_scenes, settings.images, seed, processes
    )
    torch.manual_seed(seed)
    network = VehicleNetwork(len(VehicleKind)).to(memory_format=torch.channels_last)

    def loss_of(rows: npt.NDArray[np.int64], rng: np.random.Generator) -> torch.Tensor:
        views, places = viewed(scenes[rows], vehicles[rows], rng)
        wanted = [torch.from_numpy(part) for part in targets(places)]
        batch = torch.from_numpy(as_input(views)).contiguous(memory_format=torch.channels_last)
        return _loss(network(batch), *wanted)

    train_network(network, loss_of, len(scenes), settings, folder / "training.pt")
    export(network, model)


def targets(vehicles: npt.NDArray[np.float32]) -> _Targets:
    """Target output of the network for vehicles (n, rows, 8), the nearest last.

    Returns:
        heat: (n, h, w) of cells: 1 in the middle of a vehicle, 0 elsewhere, NaN between.
        values: (n, 9, h, w) sides from the middle of the cell, kind, width and height of the box;
            NaN away from vehicles. A cell on several shows the nearest.
    """
    rows, columns = VIEW_SIZE[1] // CELL_PX, VIEW_SIZE[0] // CELL_PX
    heat = np.zeros((len(vehicles), rows, columns), np.float32)
    values = np.full((len(vehicles), _VALUES, rows, columns), np.nan, np.float32)
    x = ((np.arange(columns) + 0.5) * CELL_PX)[None, :].astype(np.float32)
    y = ((np.arange(rows) + 0.5) * CELL_PX)[:, None].astype(np.float32)
    for index, several in enumerate(vehicles):
        for vehicle in several:
            if not np.isnan(vehicle[VISIBLE]):
                _label(heat[index], values[index], vehicle, x, y)
    return heat, values


def _label(
    heat: npt.NDArray[np.float32],
    values: npt.NDArray[np.float32],
    vehicle: npt.NDArray[np.float32],
    x: npt.NDArray[np.float32],
    y: npt.NDArray[np.float32],
) -> None:
    """Write one vehicle into the targets."""
    sides = vehicle[list(_CHANNELS)]
    whole_px = vehicle[RIGHT] - vehicle[LEFT], vehicle[BOTTOM] - vehicle[TOP]
    sides[[0, 2]] = np.clip(sides[[0, 2]], 0, VIEW_SIZE[0])
    sides[[1, 3]] = np.clip(sides[[1, 3]], 0, VIEW_SIZE[1])
    left, top, right, bottom = sides[:4]
    if right - left < 2 or bottom - top < 2:
        return
    half = np.maximum([(right - left) / 2, (bottom - top) / 2], CELL_PX / 2)
    across, down = np.abs(x - (left + right) / 2), np.abs(y - (top + bottom) / 2)
    away = np.maximum(across / half[0], down / half[1])
    share = vehicle[VISIBLE] * (right - left) * (bottom - top) / (whole_px[0] * whole_px[1])
    if share < _LEAST_VISIBLE or right - left < _LEAST_WIDTH_PX:
        heat[(away <= 1.0) & (heat < 1.0)] = np.nan
        return
    inner = (away <= _INNER) | ((across <= CELL_PX / 2) & (down <= CELL_PX / 2))
    heat[(away <= 0.8) & ~inner] = np.nan
    heat[inner] = 1.0
    near = inner | (away <= _NEAR)
    relative = np.empty((_VALUES, *heat.shape), np.float32)
    relative[: len(_CHANNELS)] = sides[:, None, None]
    relative[[0, 2, 4, 5]] -= x
    relative[[1, 3]] -= y
    relative[: len(_CHANNELS)] /= SIDE_UNIT_PX
    relative[len(_CHANNELS)] = vehicle[KIND]
    relative[-2], relative[-1] = (right - left) / SIDE_UNIT_PX, (bottom - top) / SIDE_UNIT_PX
    values[:, near] = relative[:, near]


def _loss(answer: torch.Tensor, heat: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
    """Focal loss of the score, error of the sides as a share of the box, and loss of the kind."""
    known = ~heat.isnan()
    logits, wanted = answer[:, 0][known], heat[known]
    plain = nn.functional.binary_cross_entropy_with_logits(logits, wanted, reduction="none")
    missing = (wanted - logits.sigmoid()).abs()
    score_loss = (plain * missing**2).sum() / wanted.sum().clamp(min=8.0)
    near = ~values[:, 0].isnan()
    sides = len(_CHANNELS)
    there = values.permute(0, 2, 3, 1)[near]
    given = answer.permute(0, 2, 3, 1)[near]
    if not len(there):
        return score_loss
    size = there[:, [-2, -1, -2, -1, -2, -2]].clamp(min=0.3)
    error = (given[:, 1 : 1 + sides] - there[:, :sides]).abs() / size
    side_loss = error.nanmean()
    kind_loss = nn.functional.cross_entropy(given[:, 1 + sides :], there[:, sides].long())
    return score_loss + _SIDE_WEIGHT * side_loss + _KIND_WEIGHT * kind_loss


def export(network: VehicleNetwork, path: Path) -> None:
    """Write the network as ONNX, for images of any size."""
    network.eval()
    path.parent.mkdir(parents=True, exist_ok=True)
    torch.onnx.export(
        network,
        (torch.zeros(1, 3, 192, 256),),
        str(path),
        input_names=["pictures"],
        output_names=["answer"],
        dynamic_axes={"pictures": {0: "n", 2: "h", 3: "w"}, "answer": {0: "n", 2: "h8", 3: "w8"}},
        opset_version=13,
        dynamo=False,
    )
