"""A coarse grid of the voxels in which a density may be found; rays skip the others."""

from collections.abc import Iterator, Sequence

import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor
from torch.nn import functional

from styletrf.field.kernels import Kernels
from styletrf.field.radiance_field import Density

VOXELS_PER_LATTICE_POINT = 0.5  # along each axis


@torch.no_grad()
def occupied_voxels(
    density: Density,
    kernels: Kernels,
    step_length: float,
    min_alpha: float,
    *,
    settled: bool = False,
    free: Bool[Tensor, "cells cells cells"] | None = None,
) -> UInt8[Tensor, "x y z"]:
    """Returns the occupancy of a grid half as fine as the density's.

    A voxel is occupied where a step through its center, or through that of a neighbor, would have
    an opacity above `min_alpha`: density has room to grow. Where it is `settled`, the centers of
    the voxel's eighths count instead, and no neighbors: fewer samples a ray for renders. A `free`
    voxel is not occupied. If none is, all count as occupied: with an empty grid the density would
    never recover.
    """
    halved = voxels_along(density.factors.resolution)
    shape = [2 * n for n in halved] if settled else halved
    raw = torch.cat([kernels.density(density.factors, chunk) for chunk in _centers(shape, density)])
    alpha = -torch.expm1(-step_length * density.scale * functional.softplus(raw + density.shift))
    alpha = alpha.reshape(1, 1, *shape)
    largest = (
        functional.max_pool3d(alpha, kernel_size=2)
        if settled
        else functional.max_pool3d(alpha, kernel_size=3, stride=1, padding=1)
    )
    return non_empty(without(largest[0, 0] > min_alpha, free))


def initial_occupancy(free: Bool[Tensor, "cells cells cells"] | None) -> UInt8[Tensor, "x y z"]:
    """Returns the occupancy before there is a density: all that is not known to be free."""
    everything = torch.ones((1, 1, 1), dtype=torch.bool)
    return non_empty(everything if free is None else ~free)


def without(
    occupied: Bool[Tensor, "x y z"], free: Bool[Tensor, "cells cells cells"] | None
) -> Bool[Tensor, "x y z"]:
    """Returns the occupancy but for the voxels whose middle lies in a free cell."""
    if free is None:
        return occupied
    shape = tuple(occupied.shape)
    cells = functional.interpolate(free[None, None].float(), shape, mode="nearest-exact")
    return occupied & (cells[0, 0] == 0)


def remaining(
    occupied: UInt8[Tensor, "x y z"], former: UInt8[Tensor, "u v w"]
) -> UInt8[Tensor, "x y z"]:
    """Returns the occupancy but for the voxels that meet no occupied one of a former occupancy."""
    kept = functional.adaptive_max_pool3d(former[None].float(), tuple(occupied.shape))
    return non_empty((occupied & kept[0].byte()).bool())


def voxels_along(resolution: Sequence[int]) -> list[int]:
    """Returns the voxels along each axis for a density's lattice points."""
    return [max(2, round(n * VOXELS_PER_LATTICE_POINT)) for n in resolution]


def non_empty(occupied: Bool[Tensor, "x y z"]) -> UInt8[Tensor, "x y z"]:
    """Returns the occupancy; everything where it would be empty."""
    return (occupied if bool(occupied.any()) else torch.ones_like(occupied)).to(torch.uint8)


def _centers(shape: Sequence[int], density: Density) -> Iterator[Float[Tensor, "voxels 3"]]:
    """Yields the centers of the voxels slab by slab along x: all of them would fill the memory."""
    plane = density.factors.planes[0]
    x, y, z = (
        (torch.arange(n, dtype=plane.dtype, device=plane.device) + 0.5) * (2 / n) - 1 for n in shape
    )
    for slab in x.split(max(1, (1 << 20) // (len(y) * len(z)))):
        yield torch.stack(torch.meshgrid(slab, y, z, indexing="ij"), dim=-1).reshape(-1, 3)
