"""The size at which networks look at a painting: the larger it is, the larger are the strokes."""

import math
from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from styletrf.style.perceptual.perceptual_loss import shrunk
from styletrf.style.perceptual.predictor_features import LEAST_PX

LARGEST_SQUARE_PX = 2048
"""No stroke scale enlarges a painting beyond as many pixels as a square of this side has: its
features would not fit into the memory. No painting is kept with a longer shorter side."""


def scaled_painting(
    style: Float[Tensor, "height width 3"], style_px: int, stroke_scale: float
) -> Float[Tensor, "1 3 _ _"]:
    """Returns the painting at the size at which its strokes count, RGB in [0, 1].

    Args:
        style: RGB in [0, 1].
        style_px: Its shorter side for strokes of the usual size; a smaller painting keeps its own.
        stroke_scale: The factor of this side, for which the painting is enlarged if need be, within
            `greatest_scale`.
    """
    usual = _usual_px(style.shape, style_px)
    scale = min(stroke_scale, greatest_scale(style.shape, style_px))
    short_px = max(LEAST_PX, round(scale * usual))
    if short_px <= min(style.shape[:2]):
        return shrunk(style, short_px)
    enlargement = short_px / min(style.shape[:2])
    size = [round(side * enlargement) for side in style.shape[:2]]
    image = style.permute(2, 0, 1)[None]
    larger = functional.interpolate(image, size=size, mode="bicubic", antialias=True)
    return torch.clamp(larger, 0, 1)  # cubics overshoot


def greatest_scale(shape: Sequence[int], style_px: int) -> float:
    """Returns the greatest stroke scale that has an effect on a painting, at least 1.

    Args:
        shape: Height and width of the painting, in pixels.
        style_px: See `scaled_painting`.
    """
    short, long = sorted(shape[:2])
    most_px = LARGEST_SQUARE_PX * math.sqrt(short / long)
    return max(1.0, most_px / _usual_px(shape, style_px))


def scale_warnings(shape: Sequence[int], style_px: int, stroke_scale: float) -> list[str]:
    """Returns a warning about a stroke scale beyond the greatest that has an effect."""
    greatest = greatest_scale(shape, style_px)
    if stroke_scale <= greatest:
        return []
    return [
        f"a stroke scale of {stroke_scale:g} (option times setting) has the effect of"
        f" {greatest:.3g} here: it enlarges no painting beyond {LARGEST_SQUARE_PX**2:,} pixels"
    ]


def _usual_px(shape: Sequence[int], style_px: int) -> int:
    return min(style_px, *shape[:2])
