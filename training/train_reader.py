"""Teaches the reader, calibrates how sure it is, and writes it as ONNX."""

import logging
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from onboard.vision.plate_reader import ALPHABET, CERTAIN, DEFAULT_MODEL, decode, normalised
from training.networks import ReaderNetwork
from training.pictures import rendered
from training.reader_views import render_views
from training.settings import NetworkSettings

_log = logging.getLogger(__name__)

LONGEST = 8
_CALIBRATED_ON = 1500


def labelled_views(
    count: int, rng: np.random.Generator
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """Views, and their texts as class numbers, 0 behind the end."""
    views, texts = render_views(count, rng)
    labels = np.zeros((count, LONGEST), np.uint8)
    for row, text in zip(labels, texts, strict=True):
        row[: len(text)] = [ALPHABET.index(character) + 1 for character in text]
    return views, labels


def train_reader(settings: NetworkSettings, seed: int, folder: Path, processes: int) -> None:
    """Render, learn, calibrate, export; prints what it sees on the way."""
    views, labels = rendered(folder / "train", labelled_views, settings.pictures, seed, processes)
    held_back = rendered(
        folder / "validation", labelled_views, settings.validation_pictures, seed + 1, processes
    )
    torch.manual_seed(seed)
    network = ReaderNetwork().to(memory_format=torch.channels_last)
    order = np.random.default_rng(seed)
    steps = settings.epochs * (len(views) // settings.batch)
    optimiser = torch.optim.AdamW(network.parameters(), settings.peak_rate, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, settings.peak_rate, steps, pct_start=0.1
    )
    loss_of = nn.CTCLoss(zero_infinity=True)
    started, step, shown = time.monotonic(), 0, 0.0
    for epoch in range(settings.epochs):
        rows_of_epoch = order.permutation(len(views))
        network.train()
        for start in range(0, len(views) - settings.batch + 1, settings.batch):
            rows = np.sort(rows_of_epoch[start : start + settings.batch])
            batch = torch.from_numpy(normalised(np.asarray(views[rows])))
            wanted = torch.from_numpy(labels[rows].astype(np.int64))
            with torch.autocast("cpu", torch.bfloat16):
                scores = network(batch.contiguous(memory_format=torch.channels_last))
            chances = scores.float().squeeze(2).permute(2, 0, 1).log_softmax(2)
            lengths = (wanted > 0).sum(1)
            columns = torch.full((len(rows),), chances.shape[0])
            loss = loss_of(chances, wanted, columns, lengths)
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            nn.utils.clip_grad_norm_(network.parameters(), 5.0)
            optimiser.step()
            schedule.step()
            step += 1
            shown += (loss.item() - shown) / min(step, 100)
            if step % 100 == 0:
                rate = step * settings.batch / (time.monotonic() - started)
                _log.info(f"epoch {epoch} step {step}/{steps} loss {shown:.3f} {rate:.0f}/s")
        temperature = report(network, *held_back)
        export(network, temperature, DEFAULT_MODEL)
        torch.save(network.state_dict(), folder / "weights.pt")


@torch.no_grad()
def report(
    network: ReaderNetwork, views: npt.NDArray[np.uint8], labels: npt.NDArray[np.uint8]
) -> float:
    """Print how much of the rendered validation set is right; gives the temperature that fits."""
    network.eval()
    scores = torch.cat(
        [
            network(torch.from_numpy(normalised(np.asarray(views[start : start + 256]))))
            for start in range(0, len(views), 256)
        ]
    )
    scores = scores.squeeze(2).transpose(1, 2)
    texts = ["".join(ALPHABET[label - 1] for label in row if label) for row in labels]
    right = np.asarray(
        [decode(s[None]).text == text for s, text in zip(scores.numpy(), texts, strict=True)]
    )
    best = (float("inf"), 1.0)
    for temperature in np.arange(0.5, 2.01, 0.1):
        few = (scores[:_CALIBRATED_ON] / temperature).numpy()
        sure = np.clip([decode(columns[None]).confidence for columns in few], 1e-6, 1 - 1e-6)
        right_few = right[:_CALIBRATED_ON]
        surprise = -np.mean(np.where(right_few, np.log(sure), np.log(1 - sure)))
        best = min(best, (float(surprise), float(temperature)))
    sure = np.asarray([decode(columns[None]).confidence for columns in (scores / best[1]).numpy()])
    certain = sure >= CERTAIN
    _log.info(
        f"validation: exact {right.mean():.3f}; at temperature {best[1]:.1f} certain of "
        f"{certain.mean():.3f}, of these wrong {1 - right[certain].mean():.4f}"
    )
    return best[1]


def export(network: ReaderNetwork, temperature: float, path: Path) -> None:
    """Write the network with the temperature in its last layer."""
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
        (torch.zeros(1, 1, 48, 160),),
        str(path),
        input_names=["views"],
        output_names=["scores"],
        dynamic_axes={"views": {0: "n"}, "scores": {0: "n"}},
        opset_version=13,
        dynamo=False,
    )
