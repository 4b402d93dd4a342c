"""The training run of the plate reader, with calibration and export to ONNX."""

import logging
import math
from copy import deepcopy
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from onboard.vision.plate_reader import ALPHABET, CERTAIN, decode, normalised
from training.initial_weights import load_weights
from training.networks import ReaderNetwork
from training.reader_views import render_validation_plates, render_views
from training.rendered_images import rendered
from training.settings import ReaderTrainingSettings
from training.training_loop import train_network
from training.weight_averaging import average_weights

_log = logging.getLogger(__name__)

_Views = npt.NDArray[np.uint8]

LONGEST = 8
MAX_WRONG = 0.01
"""Share of wrong texts among the certain ones, with fonts that are held back."""
_CALIBRATED_ON = 2500
_MEASURED_ON = 1024


def labelled_views(count: int, rng: np.random.Generator) -> tuple[_Views, _Views]:
    """Render views, and their texts as class numbers, 0 behind the end."""
    views, texts = render_views(count, rng)
    return views, _labels(texts)


def labelled_plates(count: int, rng: np.random.Generator) -> tuple[_Views, _Views]:
    """The same of plates in fonts that are held back, with all views of each."""
    views, texts = render_validation_plates(count, rng)
    return views, _labels(texts)


def _labels(texts: list[str]) -> _Views:
    labels = np.zeros((len(texts), LONGEST), np.uint8)
    for row, text in zip(labels, texts, strict=True):
        row[: len(text)] = [ALPHABET.index(character) + 1 for character in text]
    return labels


def train_reader(
    settings: ReaderTrainingSettings, folder: Path, model: Path, processes: int
) -> None:
    """Render, train, calibrate, export and validate.

    Args:
        settings: of the run.
        folder: for images and the saved state.
        model: ONNX file to write.
        processes: to render with.
    """
    seed = settings.seed
    views, labels = rendered(folder / "train", labelled_views, settings.images, seed, processes)
    count = settings.validation_images
    held_back = rendered(folder / "validation", labelled_plates, count, seed + 1, processes)
    torch.manual_seed(seed)
    network = ReaderNetwork().to(memory_format=torch.channels_last)
    if settings.initial_network is not None:
        some = torch.from_numpy(normalised(np.asarray(views[:_MEASURED_ON])))
        load_weights(network, Path(__file__).parent / settings.initial_network, some)
    initial = deepcopy(network)
    loss_of_texts = nn.CTCLoss(zero_infinity=True)

    def loss_of(rows: npt.NDArray[np.int64], rng: np.random.Generator) -> torch.Tensor:
        batch = jittered(torch.from_numpy(normalised(np.asarray(views[rows]))), rng)
        wanted = torch.from_numpy(labels[rows].astype(np.int64))
        with torch.autocast("cpu", torch.bfloat16, enabled=settings.bfloat16):
            scores = network(batch.contiguous(memory_format=torch.channels_last))
        chances = scores.float().squeeze(2).permute(2, 0, 1).log_softmax(2)
        lengths = (wanted > 0).sum(1)
        columns = torch.full((len(rows),), chances.shape[0])
        loss: torch.Tensor = loss_of_texts(chances, wanted, columns, lengths)
        return loss

    train_network(network, loss_of, len(views), settings, folder / "training.pt")
    average_weights(network, initial, settings.initial_share)
    fitting = report(network, *held_back)
    export(network, settings.temperature or fitting, model)


def jittered(batch: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """Augment views: each gets a random affine change, gain and noise."""
    count = len(batch)
    moves = torch.zeros(count, 2, 3)
    moves[:, 0, 0] = torch.from_numpy(rng.normal(1.0, 0.03, count))
    moves[:, 1, 1] = torch.from_numpy(rng.normal(1.0, 0.05, count))
    moves[:, 0, 1] = torch.from_numpy(rng.normal(0.0, 0.03, count))
    moves[:, 1, 0] = torch.from_numpy(rng.normal(0.0, 0.03, count))
    moves[:, 0, 2] = torch.from_numpy(rng.normal(0.0, 0.03, count))
    moves[:, 1, 2] = torch.from_numpy(rng.normal(0.0, 0.06, count))
    grid = nn.functional.affine_grid(moves, list(batch.shape), align_corners=False)
    moved = nn.functional.grid_sample(batch, grid, padding_mode="border", align_corners=False)
    grain = torch.from_numpy(rng.uniform(0.0, 0.12, (count, 1, 1, 1)).astype(np.float32))
    gain = torch.from_numpy(rng.normal(1.0, 0.15, (count, 1, 1, 1)).astype(np.float32))
    noise: torch.Tensor = torch.randn(moved.shape) * grain
    return moved * gain + noise


@torch.no_grad()
def report(network: ReaderNetwork, views: _Views, labels: _Views) -> float:
    """Log the share of right texts; returns the best temperature.

    Args:
        network: after training.
        views: (n, views, h, w) of plates.
        labels: (n, 8) class numbers.
    """
    network.eval()
    scores = torch.stack(
        [
            network(torch.from_numpy(normalised(np.asarray(plate)))).squeeze(2).transpose(1, 2)
            for plate in views
        ]
    )
    texts = ["".join(ALPHABET[label - 1] for label in row if label) for row in labels]
    right = np.asarray(
        [decode(s).text == text for s, text in zip(scores.numpy(), texts, strict=True)]
    )
    temperature = _temperature(scores, right)
    sure = _confidences(scores, temperature)
    certain = sure >= CERTAIN
    _log.info(
        f"validation: exact {right.mean():.3f}; at temperature {temperature:.1f} certain of "
        f"{certain.mean():.3f}, of these wrong {1 - right[certain].mean():.4f}"
    )
    return temperature


def _temperature(scores: torch.Tensor, right: npt.NDArray[np.bool_]) -> float:
    """Temperature (Guo et al. 2017): divisor of the logits that calibrates the confidence.

    The lowest one with the least negative log-likelihood of right and wrong, and with few enough
    wrong texts among the certain ones.
    """
    few, right = scores[:_CALIBRATED_ON], right[:_CALIBRATED_ON]
    best = math.inf, 4.0
    for temperature in np.arange(0.7, best[1], 0.1):
        sure = np.clip(_confidences(few, float(temperature)), 1e-6, 1 - 1e-6)
        log_loss = -float(np.mean(np.where(right, np.log(sure), np.log(1 - sure))))
        certain = sure >= CERTAIN
        wrong = 1 - right[certain].mean() if certain.any() else 0.0
        _log.info(f"temperature {temperature:.1f}: log loss {log_loss:.4f}, wrong {wrong:.4f}")
        if wrong <= MAX_WRONG and log_loss >= best[0]:
            break
        if wrong <= MAX_WRONG:
            best = log_loss, float(temperature)
    return best[1]


def _confidences(scores: torch.Tensor, temperature: float) -> npt.NDArray[np.float64]:
    return np.asarray([decode(views).confidence for views in (scores / temperature).numpy()])


def export(network: ReaderNetwork, temperature: float, path: Path) -> None:
    """Write the network as ONNX, with the temperature in its last layer.

    Args:
        network: after training.
        temperature: divisor of the logits.
        path: of the file.
    """
    network.eval()
    with torch.no_grad():
        scaled = ReaderNetwork()
        scaled.load_state_dict(network.state_dict())
        scaled.scores.weight /= temperature
        scaled.scores.bias /= temperature
    scaled.eval()
    path.parent.mkdir(parents=True, exist_ok=True)
    torch.onnx.export(
        scaled,
        (torch.zeros(1, 1, 64, 160),),
        str(path),
        input_names=["views"],
        output_names=["scores"],
        dynamic_axes={"views": {0: "n"}, "scores": {0: "n"}},
        opset_version=13,
        dynamo=False,
    )
