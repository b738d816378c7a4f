"""The rays and colours of pixels of a set of views, by one number a pixel: nothing is stored."""

import torch
from jaxtyping import Float, Int64, UInt8
from torch import Tensor

from styletrf.kernels import Segments
from styletrf.space import ViewRays


def pixel_rays(
    rays: ViewRays, images: UInt8[Tensor, "views height width 3"], pixels: Int64[Tensor, " rays"]
) -> tuple[Segments, Float[Tensor, "rays 3"]]:
    """Returns the segments through pixels, and their colours in [0, 1].

    Args:
        rays: Of the views' cameras.
        images: Of the views.
        pixels: Numbers below views x height x width, row by row, view after view.
    """
    height, width = images.shape[1:3]
    view, pixel = pixels // (height * width), pixels % (height * width)
    row, column = pixel // width, pixel % width
    centers = torch.stack([column, row], dim=-1).double() + 0.5
    return rays.segments(view, centers), images[view, row, column].float() / 255
