"""The network that reads a painting's style: MobileNetV2 (Sandler et al., CVPR 2018).

Ghiasi et al. (BMVC 2017, arXiv 1705.06830) predict 100 numbers from a painting of 256x256 pixels,
with Inception-v3; Magenta distilled that into a MobileNetV2 for telephones. Its batch
normalizations are folded into the convolutions.
"""

from dataclasses import dataclass
from typing import cast

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from styletrf.style.transfer.network import EMBEDDING_SIZE

PAINTING_PX = 256
"""Side of the square at which a painting is read."""

_STEM, _HEAD = 32, 1280


@dataclass(frozen=True, slots=True)
class _Stage:
    """Inverted residuals of one width; the first of them has the stride."""

    expansion: int
    channels: int
    repeats: int
    stride: int


_STAGES = (  # table 2 of the paper
    _Stage(1, 16, 1, 1),
    _Stage(6, 24, 2, 2),
    _Stage(6, 32, 3, 2),
    _Stage(6, 64, 4, 2),
    _Stage(6, 96, 3, 1),
    _Stage(6, 160, 3, 2),
    _Stage(6, 320, 1, 1),
)
_LAST_OF_STRIDE = (2, 5, 12)  # the blocks whose outputs are the features at strides 4, 8 and 16


class StylePredictor(nn.Module):
    """A painting in, the 100 numbers of its style out."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = _Convolution(3, _STEM, kernel=3, stride=2)
        blocks, channels = [], _STEM
        for stage in _STAGES:
            for index in range(stage.repeats):
                stride = stage.stride if index == 0 else 1
                blocks.append(_InvertedResidual(channels, stage, stride))
                channels = stage.channels
        self.blocks = nn.Sequential(*blocks)
        self.head = _Convolution(channels, _HEAD)
        self.embedding = nn.Linear(_HEAD, EMBEDDING_SIZE)

    def forward(self, paintings: Float[Tensor, "batch 3 256 256"]) -> Float[Tensor, "batch 100"]:
        """Returns the embeddings of paintings, RGB in [0, 1]."""
        features = self.head(self.blocks(self.stem(paintings)))
        return cast("Tensor", self.embedding(features.mean(dim=(2, 3))))

    def features(
        self, images: Float[Tensor, "batch 3 height width"]
    ) -> list[Float[Tensor, "batch _ _ _"]]:
        """Returns the features at strides 4, 8 and 16: 24, 32 and 96 channels.

        Differentiable.

        Args:
            images: RGB in [0, 1], of any size from 16x16.
        """
        x, first, found = self.stem(images), 0, []
        for last in _LAST_OF_STRIDE:
            x = self.blocks[first : last + 1](x)
            first = last + 1
            found.append(x)
        return found


def style_embedding(
    predictor: StylePredictor, painting: Float[Tensor, "height width 3"]
) -> Float[Tensor, "100"]:
    """Returns the embedding of a painting of any size, without gradient and in float32.

    Args:
        predictor: The network with its weights, on the device of the painting.
        painting: RGB in [0, 1]. It is resized to 256x256, antialiased, whatever its proportions.
    """
    with torch.no_grad():
        square = functional.interpolate(
            painting.permute(2, 0, 1)[None].float(),
            size=(PAINTING_PX, PAINTING_PX),
            mode="bilinear",
            antialias=True,
        )
        return cast("Tensor", predictor(square)[0])


class _Convolution(nn.Module):
    """A convolution with TensorFlow's padding, and ReLU6 unless it is `linear`."""

    def __init__(
        self,
        n_in: int,
        n_out: int,
        *,
        kernel: int = 1,
        stride: int = 1,
        groups: int = 1,
        linear: bool = False,
    ) -> None:
        super().__init__()
        self.conv = nn.Conv2d(n_in, n_out, kernel, stride, groups=groups)
        # Sides are even: with stride 2 the one row and column of zeros come last.
        before = (kernel - 1) // 2 if stride == 1 else 0
        after = kernel - 1 - before if stride == 1 else kernel // 2
        self.padding = (before, after, before, after)
        self.linear = linear

    def forward(self, x: Tensor) -> Tensor:
        x = self.conv(functional.pad(x, self.padding))
        return x if self.linear else functional.relu6(x)


class _InvertedResidual(nn.Module):
    def __init__(self, n_in: int, stage: _Stage, stride: int) -> None:
        super().__init__()
        wide = stage.expansion * n_in
        self.expand = _Convolution(n_in, wide) if stage.expansion > 1 else nn.Identity()
        self.depthwise = _Convolution(wide, wide, kernel=3, stride=stride, groups=wide)
        self.project = _Convolution(wide, stage.channels, linear=True)
        self.adds = stride == 1 and n_in == stage.channels

    def forward(self, x: Tensor) -> Tensor:
        y = self.project(self.depthwise(self.expand(x)))
        return cast("Tensor", x + y if self.adds else y)
