"""What pictures lose by baking, measured with the field's own renderer."""

from copy import deepcopy

import numpy as np
import torch

from styletrf.field.appearance import ColorModel
from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import RadianceField
from styletrf.field.rendering import render_view
from styletrf.field.tensor_vm import TensorVM
from styletrf.field.view_rays import ViewRays
from styletrf.geometry.cameras import fitted_to
from styletrf.psnr import bounded_psnr
from styletrf.viewer.visibility import CPU, Views

_LONG_SIDE_PX, _VIEWS = 320, 3


@torch.no_grad()
def psnr_db(
    field: RadianceField,
    views: Views,
    *,
    appearance: ColorModel | None = None,
    density: TensorVM | None = None,
) -> float:
    """Returns the PSNR of pictures with another appearance or density against the field's own.

    Over three of the views, spread over all, in small pictures; at most 100 dB.

    Args:
        field: That is compared with.
        views: Of which some are rendered.
        appearance: In place of the field's.
        density: Factors in place of the field's; the occupancy is the same.
    """
    other = field
    if density is not None:
        other = deepcopy(field)
        other.density.factors = density
    spread = np.linspace(0, len(views.cameras) - 1, min(_VIEWS, len(views.cameras))).round()
    some = [fitted_to(views.cameras[int(k)], _LONG_SIDE_PX) for k in spread]
    rays = ViewRays(some, views.space.within(field.bounds), field.step_length, CPU)
    kernels, errors = kernels_for(CPU), []
    for k, camera in enumerate(some):
        own = render_view(field, kernels, rays, k, camera, views.render).color
        shown = render_view(other, kernels, rays, k, camera, views.render, appearance).color
        errors.append(float((own - shown).square().mean()))
    return bounded_psnr(float(np.mean(errors)))
