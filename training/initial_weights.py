"""Initial weights from an exported network.

An export folds batch normalisation into the convolutions. It is restored such that the network's
output does not change: statistics are measured on some inputs, and undone by its weights.
"""

import logging
from pathlib import Path
from typing import Any

import onnx
import torch
from onnx import numpy_helper
from torch import nn

_log = logging.getLogger(__name__)


@torch.no_grad()
def load_weights(network: nn.Module, exported: Path, inputs: torch.Tensor) -> None:
    """Load the weights of an exported network.

    A layer that is missing in it, or has another shape, keeps its weights and is logged.

    Args:
        network: of convolutions, each but the last followed by batch normalisation; is changed.
        exported: ONNX, as `torch.onnx` writes it: its nodes are named after the layers.
        inputs: for batch statistics.

    Raises:
        FileNotFoundError: `exported` is missing.
    """
    model = onnx.load(str(exported))
    weights = {tensor.name: tensor for tensor in model.graph.initializer}
    folded = {
        node.name.split("/")[-2]: [
            torch.from_numpy(numpy_helper.to_array(weights[name]).copy()) for name in node.input[1:]
        ]
        for node in model.graph.node
        if node.op_type == "Conv"
    }
    hooks = []
    for name, layer in network.named_modules():
        if not isinstance(layer, nn.Conv2d):
            continue
        if name not in folded or folded[name][0].shape != layer.weight.shape:
            _log.info(f"{name} keeps its random weights")
            continue
        weight, bias = folded[name]
        layer.weight.copy_(weight)
        if layer.bias is not None:
            layer.bias.copy_(bias)
        else:
            norm = network.get_submodule(f"{name.rpartition('.')[0]}.1")
            hooks.append(norm.register_forward_pre_hook(_undone(bias)))
    network.eval()
    network(inputs)
    for hook in hooks:
        hook.remove()


def _undone(bias: torch.Tensor) -> Any:
    """A hook that sets a normalisation so that it only adds `bias`."""

    def measure(norm: Any, arriving: tuple[torch.Tensor, ...]) -> None:
        mean, variance = arriving[0].mean((0, 2, 3)), arriving[0].var((0, 2, 3), correction=0)
        norm.running_mean.copy_(mean)
        norm.running_var.copy_(variance)
        norm.weight.copy_((variance + norm.eps).sqrt())
        norm.bias.copy_(bias + mean)

    return measure
