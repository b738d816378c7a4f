"""The common parts of both residual networks from images to images, at a quarter of their size.

Johnson's network (`styletrf.style.style_network`) and that of arbitrary style transfer
(`styletrf.style.transfer.network`) differ in their layers, not in how an image is brought to whole
quarters, how a block adds to its input, and how first weights are drawn.
"""

from typing import cast

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

SMALLEST_PX = 16
"""Images need at least this many pixels a side: reflection needs something to reflect."""

_REDUCTION = 4


class ResidualBlock(nn.Module):
    """Adds the output of the layers to their input."""

    def __init__(self, *layers: nn.Module) -> None:
        super().__init__()
        self.path = nn.Sequential(*layers)

    def forward(self, x: Tensor) -> Tensor:
        """Returns the sum, of the shape of `x`."""
        return cast("Tensor", x + self.path(x))


def padded_to_quarters(
    images: Float[Tensor, "batch 3 height width"],
) -> Float[Tensor, "batch 3 padded_height padded_width"]:
    """Returns images reflected at their ends, so that both sides are multiples of four.

    Raises:
        ValueError: A side is shorter than 16 pixels.
    """
    height, width = images.shape[-2:]
    if min(height, width) < SMALLEST_PX:
        raise ValueError(f"{width}x{height} pixels, at least {SMALLEST_PX} a side are needed")
    padding = (0, -width % _REDUCTION, 0, -height % _REDUCTION)
    return functional.pad(images, padding, mode="reflect")


def draw_convolutions(network: nn.Module, generator: torch.Generator) -> None:
    """Draws the weights of all convolutions, of variance 1 / fan-in; their biases are zero."""
    for module in network.modules():
        if isinstance(module, nn.Conv2d):
            fan_in = module.weight[0].numel()
            nn.init.normal_(module.weight, std=fan_in**-0.5, generator=generator)
            if module.bias is not None:
                nn.init.zeros_(module.bias)
