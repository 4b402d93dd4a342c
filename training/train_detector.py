"""The training run of the plate detector, with its export to ONNX."""

import logging
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from onboard.vision.perspective import bounding_box
from onboard.vision.plate_detector import CELL_PX, CORNER_UNIT_PX, PlateDetector, as_input
from onboard.vision.vehicle_finder import overlap
from training.detector_scenes import mirrored, moved, render_scenes
from training.initial_weights import load_weights
from training.networks import DetectorNetwork
from training.rendered_images import rendered
from training.settings import NetworkTrainingSettings
from training.training_loop import train_network

_log = logging.getLogger(__name__)

_INNER = 0.35
"""Share of the plate's half extent in which cells (and the nearest one) are labelled as plate."""
_CORNER_WEIGHT = 2.0
_MEASURED_ON = 128
_FOUND, _FALSE = 0.5, 0.1
"""Intersection over union from which a plate is found, and below which a detection is false."""


def train_detector(
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
    scenes, corners = rendered(
        folder / "train", render_scenes, settings.images, seed + 10, processes
    )
    held_back = rendered(
        folder / "validation", render_scenes, settings.validation_images, seed + 11, processes
    )
    torch.manual_seed(seed)
    # Not channels_last: with bfloat16 the gradient of a dilated convolution is then NaN.
    network = DetectorNetwork()
    if settings.initial_network is not None:
        some = torch.from_numpy(as_input(np.asarray(scenes[:_MEASURED_ON])))
        load_weights(network, Path(__file__).parent / settings.initial_network, some)

    def loss_of(rows: npt.NDArray[np.int64], rng: np.random.Generator) -> torch.Tensor:
        pictures, places = mirrored(*moved(scenes[rows], corners[rows], rng), rng)
        wanted = [torch.from_numpy(part) for part in targets(places, pictures.shape[1:])]
        batch = torch.from_numpy(as_input(pictures))
        with torch.autocast("cpu", torch.bfloat16):
            answer = network(batch).float()
        return _loss(answer, *wanted)

    train_network(network, loss_of, len(scenes), settings, folder / "training.pt")
    export(network, model)
    report(PlateDetector(model, model), *held_back)


def targets(
    corners: npt.NDArray[np.float32], size: tuple[int, ...]
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Target output of the network for plates at `corners` (n, plates, 4, 2), NaN for none.

    Returns:
        heat: (n, h, w) of cells: 1 in the middle of a plate, 0 elsewhere, NaN between.
        offsets: (n, 8, h, w) corner offsets from the middle of the cell, NaN away from plates.
        scale: (n, h, w) width of the plate in `CORNER_UNIT_PX`, 1 elsewhere.
    """
    rows, columns = size[0] // CELL_PX, size[1] // CELL_PX
    heat = np.zeros((len(corners), rows, columns), np.float32)
    offsets = np.full((len(corners), 8, rows, columns), np.nan, np.float32)
    scale = np.ones((len(corners), rows, columns), np.float32)
    x = (np.arange(columns) * CELL_PX + (CELL_PX - 1) / 2)[None, :]
    y = (np.arange(rows) * CELL_PX + (CELL_PX - 1) / 2)[:, None]
    for index, plates in enumerate(corners):
        for quad in plates:
            if np.isnan(quad).any():
                continue
            middle = quad.mean(axis=0)
            if not (0 <= middle[0] < size[1] and 0 <= middle[1] < size[0]):
                continue
            half = np.maximum(np.ptp(quad, axis=0) / 2, CELL_PX / 2)
            away = np.maximum(np.abs(x - middle[0]) / half[0], np.abs(y - middle[1]) / half[1])
            nearest = (np.abs(x - middle[0]) <= CELL_PX / 2) & (
                np.abs(y - middle[1]) <= CELL_PX / 2
            )
            inner = (away <= _INNER) | nearest
            heat[index][(away <= 1.0) & ~inner] = np.nan
            heat[index][inner] = 1.0
            relative = quad.reshape(8)[:, None, None].copy()
            relative = np.broadcast_to(relative, (8, rows, columns)).copy()
            relative[0::2] -= x
            relative[1::2] -= y
            near = away <= 0.7
            near |= inner
            offsets[index][:, near] = relative[:, near] / CORNER_UNIT_PX
            scale[index][near] = np.ptp(quad[:, 0]) / CORNER_UNIT_PX
    return heat, offsets, scale


def _loss(
    answer: torch.Tensor, heat: torch.Tensor, offsets: torch.Tensor, scale: torch.Tensor
) -> torch.Tensor:
    """Focal loss of the score, and corner error as a share of the plate's width."""
    known = ~heat.isnan()
    logits, wanted = answer[:, 0][known], heat[known]
    plain = nn.functional.binary_cross_entropy_with_logits(logits, wanted, reduction="none")
    missing = (wanted - logits.sigmoid()).abs()
    plates = wanted.sum().clamp(min=1.0)
    score_loss = (plain * missing**2).sum() / plates
    near = ~offsets[:, 0].isnan()
    error = (answer[:, 1:] - offsets.nan_to_num()).abs().mean(1)[near] / scale[near]
    corner_loss = error.sum() / max(1, int(near.sum()))
    return score_loss + _CORNER_WEIGHT * corner_loss


def export(network: DetectorNetwork, path: Path) -> None:
    """Write the network as ONNX, for images of any size."""
    network.eval()
    path.parent.mkdir(parents=True, exist_ok=True)
    torch.onnx.export(
        network,
        (torch.zeros(1, 1, 192, 256),),
        str(path),
        input_names=["pictures"],
        output_names=["answer"],
        dynamic_axes={"pictures": {0: "n", 2: "h", 3: "w"}, "answer": {0: "n", 2: "h8", 3: "w8"}},
        opset_version=13,
        dynamo=False,
    )


def report(
    detector: PlateDetector, scenes: npt.NDArray[np.uint8], corners: npt.NDArray[np.float32]
) -> None:
    """Log the share of plates found, their overlap, and false detections.

    Args:
        detector: with the trained network.
        scenes: (n, h, w) grey images.
        corners: (n, plates, 4, 2), NaN for none.
    """
    overlaps: list[float] = []
    false = 0
    for scene, quads in zip(scenes, corners, strict=True):
        found = [plate.box for plate in detector.find(scene)]
        true = [bounding_box(quad) for quad in quads if not np.isnan(quad).any()]
        overlaps += [max((overlap(box, at) for box in found), default=0.0) for at in true]
        false += sum(all(overlap(box, at) < _FALSE for at in true) for box in found)
    well = [share for share in overlaps if share >= _FOUND]
    _log.info(
        f"validation: {len(well) / max(1, len(overlaps)):.3f} of the plates found, median overlap "
        f"{np.median(well or [0.0]):.3f}, {false / len(scenes):.3f} false ones a scene"
    )
