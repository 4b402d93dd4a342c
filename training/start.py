"""Going on from a network that was exported: its weights, put back into one that can learn.

An exported network has no batch normalisation left, it is folded into the convolutions. It is given
back such that it changes nothing: what some views give is measured, and undone again.
"""

from pathlib import Path
from typing import Any

import onnx
import torch
from onnx import numpy_helper
from torch import nn


@torch.no_grad()
def take_over(network: nn.Module, exported: Path, inputs: torch.Tensor) -> None:
    """Give `network` the weights in `exported`, written from one of the same shape.

    Args:
        network: of convolutions, each but the last followed by batch normalisation.
        exported: ONNX.
        inputs: some of what it will see; batch statistics are taken from these.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it holds a network of another shape.
    """
    model = onnx.load(str(exported))
    weights = {tensor.name: tensor for tensor in model.graph.initializer}
    folded = [
        [torch.from_numpy(numpy_helper.to_array(weights[name]).copy()) for name in node.input[1:]]
        for node in model.graph.node
        if node.op_type == "Conv"
    ]
    layers = [layer for layer in network.modules() if isinstance(layer, nn.Conv2d)]
    norms = [layer for layer in network.modules() if isinstance(layer, nn.BatchNorm2d)]
    if [tuple(weight.shape) for weight, _ in folded] != [tuple(n.weight.shape) for n in layers]:
        raise ValueError(f"{exported} holds a network of another shape")
    for layer, (weight, _) in zip(layers, folded, strict=True):
        layer.weight.copy_(weight)
    if (last := layers[-1].bias) is not None:
        last.copy_(folded[-1][1])
    hooks = []
    for norm, (_, bias) in zip(norms, folded, strict=False):
        hooks.append(norm.register_forward_pre_hook(_undone(bias)))
    network.eval()
    network(inputs)
    for hook in hooks:
        hook.remove()


def _undone(bias: torch.Tensor) -> Any:
    """A hook that lets a normalisation do nothing but add `bias`."""

    def measure(norm: Any, arriving: tuple[torch.Tensor, ...]) -> None:
        mean, variance = arriving[0].mean((0, 2, 3)), arriving[0].var((0, 2, 3), correction=0)
        norm.running_mean.copy_(mean)
        norm.running_var.copy_(variance)
        norm.weight.copy_((variance + norm.eps).sqrt())
        norm.bias.copy_(bias + mean)

    return measure
