"""Where a density may be found: a coarse grid of voxels that rays do not pass over."""

from collections.abc import Sequence

import torch
from jaxtyping import Float, UInt8
from torch import Tensor
from torch.nn import functional

from styletrf.field import Density
from styletrf.kernels import Kernels

VOXELS_PER_LATTICE_POINT = 0.5  # along each axis


@torch.no_grad()
def occupied_voxels(
    density: Density, kernels: Kernels, step_length: float, min_alpha: float
) -> UInt8[Tensor, "x y z"]:
    """Returns the occupancy of a grid half as fine as the density's.

    A voxel is occupied where a step through its centre, or through that of a neighbour, would have
    an opacity above `min_alpha`. If nothing is, everything counts as occupied: an empty grid would
    never let the density recover.
    """
    shape = [max(2, round(n * VOXELS_PER_LATTICE_POINT)) for n in density.factors.resolution]
    raw = torch.cat(
        [
            kernels.density(density.factors, chunk)
            for chunk in _centers(shape, density).split(1 << 20)
        ]
    )
    alpha = -torch.expm1(-step_length * density.scale * functional.softplus(raw + density.shift))
    dilated = functional.max_pool3d(
        alpha.reshape(1, 1, *shape), kernel_size=3, stride=1, padding=1
    )[0, 0]
    occupied = dilated > min_alpha
    return (occupied if bool(occupied.any()) else torch.ones_like(occupied)).to(torch.uint8)


def _centers(shape: Sequence[int], density: Density) -> Float[Tensor, "voxels 3"]:
    plane = density.factors.planes[0]
    axes = [
        (torch.arange(n, dtype=plane.dtype, device=plane.device) + 0.5) * (2 / n) - 1 for n in shape
    ]
    return torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1).reshape(-1, 3)
