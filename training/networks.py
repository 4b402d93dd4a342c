"""The networks, of layers that OpenCV's `dnn` runs fast: convolutions and pooling."""

import torch
from torch import nn
from typing_extensions import override

from onboard.vision.vehicle_network import SIDES

CLASSES = 37
"""Blank and the reader's alphabet."""


def _conv(
    inputs: int,
    outputs: int,
    size: int | tuple[int, int] = 3,
    *,
    stride: int = 1,
    padding: int | tuple[int, int] = 1,
    dilation: int | tuple[int, int] = 1,
    groups: int = 1,
) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(
            inputs,
            outputs,
            size,
            stride=stride,
            padding=padding,
            dilation=dilation,
            groups=groups,
            bias=False,
        ),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


def _far(channels: int, reach: int) -> nn.Sequential:
    """A dilated convolution of each channel, `reach` cells wide, and a 1 x 1 convolution of all."""
    return nn.Sequential(
        _conv(channels, channels, padding=reach, dilation=reach, groups=channels),
        _conv(channels, channels, 1, padding=0),
    )


class ReaderNetwork(nn.Module):
    """Reader: (n, 1, 64, 160) normalised grey views to (n, 37, 1, 40) logits of class by column."""

    def __init__(self) -> None:
        super().__init__()
        self.strokes = nn.Sequential(
            _conv(1, 32, stride=2),
            _conv(32, 48),
            nn.MaxPool2d((2, 1)),
            _conv(48, 64),
            nn.MaxPool2d((2, 2)),
            _conv(64, 96),
            _conv(96, 112),
        )
        self.columns = _conv(112, 192, (8, 1), padding=0)
        self.context = nn.ModuleList(
            _conv(192, 192, (1, 5), padding=(0, 2 * reach), dilation=(1, reach))
            for reach in (1, 2, 4, 8)
        )
        self.dropout = nn.Dropout2d(0.1)
        self.scores = nn.Conv2d(192, CLASSES, 1)

    @override
    def forward(self, views: torch.Tensor) -> torch.Tensor:
        seen = self.columns(self.strokes(views))
        for layer in self.context:
            seen = seen + layer(seen)
        scores: torch.Tensor = self.scores(self.dropout(seen))
        return scores


class DetectorNetwork(nn.Module):
    """Detector: (n, 1, h, w) logarithmic grey to (n, 9, h / 8, w / 8) logit and corner offsets."""

    def __init__(self) -> None:
        super().__init__()
        self.edges = nn.Sequential(
            _conv(1, 16, stride=2),
            _conv(16, 24, stride=2),
            _conv(24, 32),
            _conv(32, 56, stride=2),
        )
        # OpenCV computes dilated convolutions three times slower: those are depthwise.
        self.context = nn.ModuleList(
            _conv(56, 56) if reach == 1 else _far(56, reach) for reach in (1, 2, 1, 4, 1)
        )
        self.answer = nn.Conv2d(56, 9, 1)
        nn.init.constant_(self.answer.bias, 0.0)
        with torch.no_grad():
            self.answer.bias[0] = -4.0  # plates are rare

    @override
    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        seen = self.edges(pictures)
        for layer in self.context:
            seen = seen + layer(seen)
        answer: torch.Tensor = self.answer(seen)
        return answer


class VehicleNetwork(nn.Module):
    """Vehicles: (n, 3, h, w) logarithmic BGR to (n, 12, h / 8, w / 8).

    A logit, six sides in units of `SIDE_UNIT_PX`, and logits of the kinds. Near vehicles are many
    cells wide: what cells of 16 and 32 pixels know of the surroundings is added to those of 8.
    """

    def __init__(self, kinds: int = 5) -> None:
        super().__init__()
        self.edges = _conv(3, 32, 6, stride=4)
        self.fine = nn.Sequential(_conv(32, 48, stride=2), Residual(48), Residual(48))
        self.middle = nn.Sequential(_down(48, 96), *(Residual(96) for _ in range(4)))
        self.coarse = nn.Sequential(_down(96, 192), *(Residual(192) for _ in range(5)))
        self.to_middle = _conv(192, 96, 1, padding=0)
        self.to_fine = _conv(96, 64, 1, padding=0)
        self.from_fine = _conv(48, 64, 1, padding=0)
        self.mixed = nn.Sequential(Residual(64), Residual(64))
        self.answer = nn.Conv2d(64, 1 + SIDES + kinds, 1)
        nn.init.constant_(self.answer.bias, 0.0)
        with torch.no_grad():
            self.answer.bias[0] = -4.0  # vehicles are rare

    @override
    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        fine = self.fine(self.edges(pictures))
        middle = self.middle(fine)
        above = self.to_middle(self.coarse(middle))
        middle = middle + nn.functional.interpolate(above, scale_factor=2.0)
        wide = nn.functional.interpolate(self.to_fine(middle), scale_factor=2.0)
        answer: torch.Tensor = self.answer(self.mixed(self.from_fine(fine) + wide))
        return answer


def _down(inputs: int, outputs: int) -> nn.Sequential:
    """Half the size: a convolution of each channel, and a 1 x 1 convolution of all."""
    return nn.Sequential(
        _conv(inputs, inputs, stride=2, groups=inputs), _conv(inputs, outputs, 1, padding=0)
    )


class Residual(nn.Module):
    """A convolution of each channel and a 1 x 1 convolution of all, added."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            _conv(channels, channels, groups=channels),
            _conv(channels, channels, 1, padding=0),
        )

    @override
    def forward(self, cells: torch.Tensor) -> torch.Tensor:
        return cells + self.layers(cells)
