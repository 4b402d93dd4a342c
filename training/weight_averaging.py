"""Average of the weights before and after a training run.

The average keeps part of what was learnt from earlier images and much of what is new, and often has
fewer errors than either network on new data (Wortsman et al. 2022, Robust fine-tuning of zero-shot
models). It costs no time in the car: the network has the same shape.
"""

import torch
from torch import nn


@torch.no_grad()
def average_weights(network: nn.Module, initial: nn.Module, share: float) -> None:
    """Average the weights of both networks into `network`.

    Args:
        network: after the training run; is changed.
        initial: before it.
        share: weight of `initial`, 0 to 1.
    """
    for each in (network, initial):
        _fold(each)
    for mine, other in zip(network.parameters(), initial.parameters(), strict=True):
        mine.lerp_(other, share)


def _fold(network: nn.Module) -> None:
    """Fold batch normalisations into the convolutions before them, as an export does.

    Only then are the weights of two networks comparable.
    """
    for name, norm in network.named_modules():
        if not isinstance(norm, nn.BatchNorm2d):
            continue
        convolution = network.get_submodule(f"{name.rpartition('.')[0]}.0")
        mean, variance = norm.running_mean, norm.running_var
        if not isinstance(convolution, nn.Conv2d) or mean is None or variance is None:
            raise TypeError(f"{name} follows no convolution, or has no statistics")
        scale = norm.weight / (variance + norm.eps).sqrt()
        convolution.weight.mul_(scale[:, None, None, None])
        norm.bias.sub_(mean * scale)
        norm.weight.fill_(1.0)
        mean.zero_()
        variance.fill_(1.0 - norm.eps)
