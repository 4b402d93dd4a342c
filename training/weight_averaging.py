"""Half-way between the network that a schooling began with and the one that it ended with.

What was learnt from other views is not all forgotten there, and much of what is new is kept: such a
mean is often right more often than either on what neither has seen (Wortsman et al. 2022, Robust
fine-tuning of zero-shot models). It costs the car nothing: it is one network of the same shape.
"""

import torch
from torch import nn


@torch.no_grad()
def average_weights(network: nn.Module, began: nn.Module, share: float) -> None:
    """Give `network` the mean of both networks' weights, `share` of them from `began`."""
    for each in (network, began):
        _fold(each)
    for mine, other in zip(network.parameters(), began.parameters(), strict=True):
        mine.lerp_(other, share)


def _fold(network: nn.Module) -> None:
    """Put normalisations into the convolutions before them, as an export does.

    Then the weights of two networks mean the same.
    """
    for name, norm in network.named_modules():
        if not isinstance(norm, nn.BatchNorm2d):
            continue
        convolution = network.get_submodule(f"{name.rpartition('.')[0]}.0")
        mean, variance = norm.running_mean, norm.running_var
        if not isinstance(convolution, nn.Conv2d) or mean is None or variance is None:
            raise TypeError(f"{name} follows no convolution, or measures nothing")
        scale = norm.weight / (variance + norm.eps).sqrt()
        convolution.weight.mul_(scale[:, None, None, None])
        norm.bias.sub_(mean * scale)
        norm.weight.fill_(1.0)
        mean.zero_()
        variance.fill_(1.0 - norm.eps)
