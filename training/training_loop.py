"""The training loop of both networks: batches, learning rate, and saved states.

Everything depends on the number of the step alone, so that an interrupted run continues as the same
run. The learning rate rises, stays, and falls to zero (warm-up, stable, decay; Hu et al. 2024,
MiniCPM, section 4): the lengths of the last two phases can be decided late.
"""

import logging
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from training.settings import NetworkTrainingSettings

_log = logging.getLogger(__name__)

Rows = npt.NDArray[np.int64]
LossOf = Callable[[Rows, np.random.Generator], torch.Tensor]
"""Loss of the images in these rows; the generator is for augmentation."""

_SAVED_EVERY = 200


def train_network(
    network: nn.Module,
    loss_of: LossOf,
    images: int,
    settings: NetworkTrainingSettings,
    saved: Path,
) -> None:
    """Train a network, from the state in `saved` if it exists.

    Args:
        network: is changed.
        loss_of: loss of a batch.
        images: number of images.
        settings: steps, rates and batch size.
        saved: file of the state.
    """
    optimiser = torch.optim.AdamW(network.parameters(), weight_decay=1e-3)
    step = 0
    if saved.is_file():
        state = torch.load(saved, weights_only=True)
        network.load_state_dict(state["network"])
        optimiser.load_state_dict(state["optimiser"])
        step = state["step"]
    seed = settings.seed
    started, first, shown = time.monotonic(), step, 0.0
    network.train()
    while step < settings.steps:
        for group in optimiser.param_groups:
            group["lr"] = settings.rate_at(step)
        torch.manual_seed(seed + step)
        loss = loss_of(
            rows_of(step, images, settings.batch, seed), np.random.default_rng([seed, step])
        )
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 5.0)
        optimiser.step()
        step += 1
        shown += (loss.item() - shown) / min(step - first, 100)
        if step % 50 == 0:
            speed = (step - first) * settings.batch / (time.monotonic() - started)
            _log.info(f"step {step}/{settings.steps} loss {shown:.3f} {speed:.0f}/s")
        if step % _SAVED_EVERY == 0 or step == settings.steps:
            part = saved.with_suffix(".part")
            state = {"network": network.state_dict(), "optimiser": optimiser.state_dict()}
            torch.save({**state, "step": step}, part)
            part.rename(saved)


def rows_of(step: int, images: int, batch: int, seed: int) -> Rows:
    """Rows of the images of one step: each epoch has all images once, in random order.

    Args:
        step: counted from 0.
        images: number of images.
        batch: images a step.
        seed: of the order.
    """
    steps_per_epoch = images // batch
    order = np.random.default_rng([seed, step // steps_per_epoch]).permutation(images)
    start = step % steps_per_epoch * batch
    return np.sort(order[start : start + batch])
