"""The schedule of a fit from coarse to fine: grids, steps of the march, learning rates."""

import math
from collections.abc import Sequence

from styletrf.geometry.space import Space


def stage_resolution(
    final: Sequence[int], initial_voxels: int, stage: int, stages: int
) -> tuple[int, int, int]:
    """Returns the lattice of a stage, between `initial_voxels` and `final` geometrically.

    Stage 0 has about `initial_voxels`, stage `stages` the final resolution (TensoRF section 4.2).
    """
    fraction = stage / stages if stages else 1.0
    ratio = min(1.0, initial_voxels / math.prod(final)) ** ((1 - fraction) / 3)
    x, y, z = (max(2, round(n * ratio)) for n in final)
    return x, y, z


def march_step(space: Space, resolution: Sequence[int], steps_per_voxel: float) -> float:
    """Returns the optical length of a step: `steps_per_voxel` steps to the mean voxel side."""
    sides = [2 * length / (n - 1) for length, n in zip(space.axis_lengths, resolution, strict=True)]
    return float(math.prod(sides) ** (1 / 3)) / steps_per_voxel


def decay(rate_decay: float, done: int, total: int) -> float:
    """Returns the factor that falls exponentially from 1 to `rate_decay` over `total`."""
    return float(rate_decay ** (done / total))
