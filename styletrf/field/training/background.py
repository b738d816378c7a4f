"""The color with which the background of a fit begins."""

import torch

from styletrf.capture.view_images import ViewImages
from styletrf.field.pixel_rays import pixel_rays
from styletrf.field.radiance_field import RadianceField
from styletrf.field.view_rays import ViewRays

LEAST_MISSED = 64  # rays that show the background
_RAYS = 1 << 14


@torch.no_grad()
def begin_with_background(
    field: RadianceField, rays: ViewRays, images: ViewImages, generator: torch.Generator
) -> None:
    """Sets the background to the mean color of rays that miss the grid, if there are any.

    Learning it takes a thousand iterations, long enough for walls of its color to grow.
    """
    pixels = images.drawn(_RAYS, generator)
    segments, target = pixel_rays(rays, images, pixels)
    missed = target[segments.n_steps == 0]
    if len(missed) >= LEAST_MISSED:
        color = missed.mean(dim=0).clamp(1 / 512, 1 - 1 / 512)
        field.appearance.background.copy_(torch.logit(color))
