"""Paints one view by optimizing its pixels (Gatys, Ecker and Bethge, CVPR 2016).

The paper's comparison for the feed-forward network: slower by two orders, and every view finds its
own optimum, so neighbors disagree.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from styletrf.configuration import SEEDS, require_at_least, require_within
from styletrf.finiteness import require_finite
from styletrf.progress import Progress, silent
from styletrf.style.perceptual.painting_size import scaled_painting
from styletrf.style.perceptual.perceptual_loss import (
    PerceptualLossConfig,
    perceptual_loss,
    style_grams,
)
from styletrf.style.perceptual.vgg import VGG16
from styletrf.style.residual_network import SMALLEST_PX


@dataclass(frozen=True, slots=True)
class GatysConfig:
    """Settings of the optimization of a view; most of it runs at half the view's size."""

    loss: PerceptualLossConfig = field(default_factory=PerceptualLossConfig)
    style_px: int = 420  # shorter side of the style image
    stroke_scale: float = 1.0  # of that side; see `scaled_painting`
    start: Literal["network", "content", "noise"] = "network"
    iterations: tuple[int, ...] = (60, 20)  # at half and at full size
    rate: float = 0.04  # Adam's, of colors in [0, 1]
    seed: int = 0  # of the noise

    def __post_init__(self) -> None:
        require_within(SEEDS, self, "seed")
        require_at_least(SMALLEST_PX, self, "style_px")
        require_within("(0, inf)", self, "rate", "stroke_scale")
        if not self.iterations or min(self.iterations) < 0:
            raise ValueError(f"iterations are {self.iterations}, not one or more from 0")


def paint_by_optimization(
    vgg: VGG16,
    content: Float[Tensor, "height width 3"],
    style: Float[Tensor, "_ _ 3"],
    config: GatysConfig,
    progress: Progress = silent,
    begin: Float[Tensor, "height width 3"] | None = None,
) -> Float[Tensor, "height width 3"]:
    """Returns the view painted in the style, in [0, 1].

    The optimization starts from a painting by a network, from the view itself, or from noise.

    Args:
        vgg: The perceptual network.
        content: RGB in [0, 1].
        style: RGB in [0, 1].
        config: The settings of the optimization.
        progress: Called with the iteration and the loss.
        begin: The view as a network paints it, for the start `network`.

    Raises:
        ValueError: The start is `network`, and `begin` is missing.
        NotFiniteError: The loss stopped being finite, or one of its images is not finite.
    """
    grams = style_grams(vgg, scaled_painting(style, config.style_px, config.stroke_scale))
    plain = content.permute(2, 0, 1)[None]
    height, width = content.shape[:2]
    painted, done = _started(plain, begin, config), 0
    for level, iterations in enumerate(config.iterations):
        scale = 0.5 ** (len(config.iterations) - 1 - level)
        size = [max(16, round(scale * side)) for side in (height, width)]
        painted, target = (
            functional.interpolate(i, size=size, mode="bilinear", antialias=True)
            for i in (painted, plain)
        )
        painted = painted.clone().requires_grad_()
        optimizer = torch.optim.Adam([painted], lr=config.rate)
        for _ in range(iterations):
            terms = perceptual_loss(vgg, painted, target, grams, config.loss)
            optimizer.zero_grad()
            terms.total.backward()
            optimizer.step()
            done += 1
            loss = float(terms.total.detach())
            if not math.isfinite(loss):
                stages = [("view", content), *grams.items(), ("painted view", painted)]
                stages = [*stages, ("loss", terms.total.detach())]
                require_finite("painting by optimization", f"at iteration {done}", stages)
            progress(done, sum(config.iterations), loss=loss)
        painted = painted.detach().clamp(0, 1)
    return painted[0].permute(1, 2, 0).contiguous()


def _started(
    plain: Float[Tensor, "1 3 height width"],
    begin: Float[Tensor, "height width 3"] | None,
    config: GatysConfig,
) -> Float[Tensor, "1 3 height width"]:
    if config.start == "content":
        return plain
    if config.start == "noise":
        generator = torch.Generator().manual_seed(config.seed)
        return torch.rand(plain.shape, generator=generator).to(plain)
    if begin is None:
        raise ValueError("the start is a network's painting, which is missing")
    return begin.permute(2, 0, 1)[None]
