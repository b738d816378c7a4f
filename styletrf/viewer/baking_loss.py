"""Measures the loss of pictures by baking, with the field's own renderer."""

from collections.abc import Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.even_spread import evenly_spread
from styletrf.field.appearance import ColorModel
from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import RadianceField
from styletrf.field.rendering import render_view
from styletrf.field.tensor_vm import TensorVM
from styletrf.field.view_rays import ViewRays
from styletrf.geometry.cameras import fitted_to
from styletrf.psnr import bounded_psnr
from styletrf.viewer.visibility import CPU, Views

_LONG_SIDE_PX, _VIEWS = 320, 5


@dataclass(frozen=True, slots=True)
class BakingLoss:
    """The PSNR of pictures against a field's own, over five of the views, spread over all.

    Attributes:
        mean_db: The PSNR of the mean squared error; at most 100.
        least_db: The PSNR of the view with the greatest error; at most 100.
    """

    mean_db: float
    least_db: float


def baking_loss(
    field: RadianceField,
    views: Views,
    *,
    appearance: ColorModel | None = None,
    density: TensorVM | None = None,
) -> BakingLoss:
    """Returns the loss of pictures by another appearance or density.

    Args:
        field: The field that is compared with.
        views: The views, of which some are rendered in small pictures.
        appearance: The appearance in place of the field's.
        density: Factors in place of the field's; the occupancy is the same.
    """
    return loss_against(own_pictures(field, views), field, views, appearance, density)


@torch.no_grad()
def own_pictures(field: RadianceField, views: Views) -> list[Float[Tensor, "height width 3"]]:
    """Returns small pictures of a field from some views."""
    return list(_pictures(field, views, None))


@torch.no_grad()
def loss_against(
    own: Sequence[Float[Tensor, "height width 3"]],
    field: RadianceField,
    views: Views,
    appearance: ColorModel | None = None,
    density: TensorVM | None = None,
) -> BakingLoss:
    """Returns the loss of pictures against a field's own; see `baking_loss`."""
    other = field
    if density is not None:
        other = deepcopy(field)
        other.density.factors = density
    errors = [
        float((exact - shown).square().mean())
        for exact, shown in zip(own, _pictures(other, views, appearance), strict=True)
    ]
    return BakingLoss(bounded_psnr(float(np.mean(errors))), bounded_psnr(max(errors)))


def _pictures(
    field: RadianceField, views: Views, appearance: ColorModel | None
) -> Iterator[Float[Tensor, "height width 3"]]:
    some = [fitted_to(camera, _LONG_SIDE_PX) for camera in evenly_spread(views.cameras, _VIEWS)]
    rays = ViewRays(some, views.space.within(field.bounds), field.step_length, CPU)
    kernels = kernels_for(CPU)
    for k, camera in enumerate(some):
        yield render_view(field, kernels, rays, k, camera, views.render, appearance).color
