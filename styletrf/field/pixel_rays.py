"""Computes the rays and colors of views' pixels from one number a pixel; nothing is stored."""

from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.capture.view_images import ViewImages
from styletrf.field.kernels import RaySegments
from styletrf.field.view_rays import ViewRays


def pixel_rays(
    rays: ViewRays, images: ViewImages, pixels: Int64[Tensor, " rays"]
) -> tuple[RaySegments, Float[Tensor, "rays 3"]]:
    """Returns the segments through pixels, and their colors in [0, 1].

    Args:
        rays: The rays of the views' cameras.
        images: The images of the views.
        pixels: The pixels by their numbers, see `styletrf.capture.view_images`.
    """
    view, centers = images.places(pixels)
    return rays.segments(view, centers), images.pixels[pixels].float() / 255
