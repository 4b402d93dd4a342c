"""What both networks' schooling shares: which pictures when, how fast to learn, how to go on later.

Everything depends on the number of the step alone, so that a run that was broken off and went on is
the same run. The learning rate rises, stays, and falls to nothing (warm-up, stable, decay; Hu et
al. 2024, MiniCPM, section 4): how long the middle lasts, and the fall, may be decided late.
"""

import logging
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from training.settings import NetworkSettings

_log = logging.getLogger(__name__)

Rows = npt.NDArray[np.int64]
LossOf = Callable[[Rows, np.random.Generator], torch.Tensor]
"""Loss of the pictures in these rows; the generator is for changing them a little."""

_SAVED_EVERY = 200


def train_network(
    network: nn.Module,
    loss_of: LossOf,
    pictures: int,
    settings: NetworkSettings,
    saved: Path,
) -> None:
    """All steps of one network's schooling, from where `saved` has it, if it is there."""
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
            rows_of(step, pictures, settings.batch, seed), np.random.default_rng([seed, step])
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


def rows_of(step: int, pictures: int, batch: int, seed: int) -> Rows:
    """Which pictures a step learns from: all of them once, in some order, then all again."""
    a_round = pictures // batch
    order = np.random.default_rng([seed, step // a_round]).permutation(pictures)
    start = step % a_round * batch
    return np.sort(order[start : start + batch])
