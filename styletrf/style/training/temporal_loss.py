"""The temporal loss: a term of the style training for stability under small camera motion.

Where two images show the same, and the place of each pixel of the first in the second is known, the
painted versions should show the same, too:

    loss = mean over valid pixels p of (f(a)(p) - f(b)(p + flow(p)))^2 / variance of f(a)

(without the variance a network grows steady by growing gray).

For a photograph the second image is itself, moved by a fraction of a pixel and noisy, as a render
from a little further on would be (noise stability as in Gupta et al. 2017, arXiv 1705.02092); for
renders of a scene it is a nearby render, and the field's depth gives the flow exactly.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from styletrf.configuration import require_at_least, require_within
from styletrf.geometry.tensor_sampling import sample_tensor_at

_LEAST_VARIANCE = 1e-3  # on [0, 1]: hardly any contrast


@dataclass(frozen=True, slots=True)
class TemporalLossConfig:
    """The weight of the temporal loss, and its disturbances."""

    weight: float = 0.5
    every: int = 2  # iterations between looks at it; the weight counts as many times
    shift_px: float = 4.0  # a photograph is moved by at most this along each axis
    noise: float = 0.02  # standard deviation, of [0, 1]
    renders: float = 0.0  # of these, the fraction that looks at renders of the scene

    def __post_init__(self) -> None:
        require_at_least(1, self, "every")
        require_within("[0, inf)", self, "weight", "shift_px", "noise")
        require_within("[0, 1]", self, "renders")


@dataclass(frozen=True, slots=True)
class ContentPair:
    """Two images of the same content.

    Attributes:
        first: RGB in [0, 1].
        second: The same content, a little moved.
        flow_px: The displacement (x, y) from each pixel of the first to its place in the second.
        valid: Where the flow can be trusted.
    """

    first: Float[Tensor, "batch 3 height width"]
    second: Float[Tensor, "batch 3 height width"]
    flow_px: Float[Tensor, "batch height width 2"]
    valid: Bool[Tensor, "batch height width"]


def jittered_pair(
    content: Float[Tensor, "batch 3 height width"],
    config: TemporalLossConfig,
    generator: torch.Generator,
) -> ContentPair:
    """Returns photographs with themselves, moved and noisy."""
    batch, _, height, width = content.shape
    shift = torch.rand((batch, 1, 1, 2), generator=generator) * 2 - 1
    flow = (config.shift_px * shift).expand(batch, height, width, 2).to(content)
    # the content at p + flow in the second is at p in the first
    moved, _ = warp_along(content, -flow)
    noise = torch.randn(content.shape, generator=generator).to(content)
    _, valid = warp_along(content, flow)
    return ContentPair(content, moved + config.noise * noise, flow, valid)


def temporal_loss(
    first: Float[Tensor, "batch 3 height width"],
    second: Float[Tensor, "batch 3 height width"],
    pair: ContentPair,
) -> Float[Tensor, ""]:
    """Returns how much of the first's variance the pair differs by; 0 where nothing is valid.

    Differentiable in both. The variance counts as at least 1e-3, as for a picture without contrast.
    """
    there, inside = warp_along(second, pair.flow_px)
    valid = (pair.valid & inside)[:, None]
    difference = torch.where(valid, first - there, 0).square().sum()
    difference = difference / (first.shape[1] * valid.sum().clamp(min=1))
    variance = first.var(dim=(2, 3), unbiased=False).mean()
    return difference / variance.clamp(min=_LEAST_VARIANCE)


def warp_along(
    images: Float[Tensor, "batch channels height width"],
    flow_px: Float[Tensor, "batch height width 2"],
) -> tuple[Float[Tensor, "batch channels height width"], Bool[Tensor, "batch height width"]]:
    """Returns the color at p + flow(p) for each pixel p, bilinear, and where that is inside.

    Differentiable in the images. Outside, the color is that of the nearest border pixel.
    """
    height, width = images.shape[-2:]
    y, x = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    places = torch.stack([x, y], dim=-1).to(flow_px) + flow_px
    last = flow_px.new_tensor([width - 1, height - 1])
    inside = ((places >= 0) & (places <= last)).all(dim=-1)
    return sample_tensor_at(images, places, "border"), inside
