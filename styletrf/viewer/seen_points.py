"""The lattice points that views show, in classes by how much they change pictures."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Shaped

from styletrf.field.radiance_field import RadianceField
from styletrf.field.tensor_vm import TensorVM
from styletrf.viewer.lattice import BrickLattice, brick_lattice, occupied_cells
from styletrf.viewer.point_effects import Classes, effect_classes, point_effects
from styletrf.viewer.visibility import Views

Resolution = tuple[int, int, int]
"""Points along x, y and z."""
_FINER = 1.5
_SHRINK = 0.95  # at most so much of a lattice's sides, as often as it has too many bricks


@dataclass(frozen=True, slots=True)
class SeenPoints:
    """The points of a lattice that have colors.

    Attributes:
        voxels: The voxels that views see, see `seen_voxels`.
        most_bricks: The most bricks of each lattice.
        of_paintings: The points of the paintings' lattices, None if there is no painting yet.
        found: The classes that looks share, by the lattice's points and the weight power.
    """

    voxels: Bool[np.ndarray, "x y z"]
    most_bricks: int
    of_paintings: Resolution | None = None
    found: dict[tuple[Resolution, float], Classes] = field(default_factory=dict)

    def within(self, factors: TensorVM) -> tuple[TensorVM, BrickLattice]:
        """Returns the factors and their lattice; see `lattice_within`."""
        return lattice_within(factors, self.voxels, self.most_bricks)

    def lattice(self, resolution: Resolution) -> BrickLattice:
        """Returns the lattice of so many points, or a coarser one that has few enough bricks."""
        return _lattice_within(resolution, self.voxels, self.most_bricks)

    def finer(self, resolution: Resolution) -> Resolution:
        """Returns the points at which a refit fits the colors of a field with so many points.

        A color network bends features between a field's own points, so these are too few. The
        points of paintings serve, for then photographs and paintings share classes; where no
        painting is known, there are half as many again along each axis.
        """
        if self.of_paintings is not None:
            return self.of_paintings
        x, y, z = (round(_FINER * side) for side in resolution)
        return x, y, z

    def classes(self, field: RadianceField, views: Views, lattice: BrickLattice) -> Classes:
        """Returns the classes of a field's points; see `point_effects`."""
        key = lattice.resolution, field.appearance.weight_power
        if key not in self.found:
            self.found[key] = effect_classes(point_effects(field, views, lattice))
        return self.found[key]


def lattice_within(
    factors: TensorVM, voxels: Shaped[np.ndarray, "x y z"], most_bricks: int
) -> tuple[TensorVM, BrickLattice]:
    """Returns the factors and their lattice in the voxels, coarser until it has few bricks."""
    lattice = _lattice_within(factors.resolution, voxels, most_bricks)
    if lattice.resolution == factors.resolution:
        return factors, lattice
    return factors.upsampled(lattice.resolution), lattice


def _lattice_within(
    resolution: Resolution, voxels: Shaped[np.ndarray, "x y z"], most_bricks: int
) -> BrickLattice:
    lattice = brick_lattice(occupied_cells(voxels, resolution), resolution)
    while lattice.n_bricks > most_bricks:  # they grow as the square to the cube
        scale = min(_SHRINK, (most_bricks / lattice.n_bricks) ** 0.4)
        x, y, z = (max(2, round(scale * side)) for side in lattice.resolution)
        lattice = brick_lattice(occupied_cells(voxels, (x, y, z)), (x, y, z))
    return lattice
