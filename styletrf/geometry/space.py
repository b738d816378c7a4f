"""Maps the normalized world to the grid of the field.

A space is a few 4x4 projective maps `grid_from_world`, each for the part of the world where its
homogeneous w is the largest: one affine map for a box, one perspective for NDC (Mildenhall et al.
2020, appendix C), seven for unbounded space (`styletrf.scene.contraction`). Projective maps keep
rays straight, so a pixel's ray is a chain of straight pieces of the grid
(`styletrf.field.view_rays`).
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, slots=True)
class Space:
    """The map to grid coordinates and the metric of optical length.

    `axis_lengths` are the lengths of the grid's axes in units of optical length: half extents of
    the box in the normalized world, or 1 for NDC, whose own coordinates measure it. In unbounded
    space they are such that the inner box has the lengths of the normalized world.
    """

    kind: Literal["ndc", "box", "unbounded"]
    grid_from_world: Float[np.ndarray, "maps 4 4"]
    axis_lengths: tuple[float, float, float]
    depth_min: float

    def to_grid(self, points_world: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, "points 3"]:
        """Returns grid coordinates of points of the normalized world, in front of all cameras."""
        ones = np.ones((len(points_world), 1))
        images = np.einsum("mij,pj->pmi", self.grid_from_world, np.hstack([points_world, ones]))
        images = images[np.arange(len(images)), images[:, :, 3].argmax(axis=1)]
        grid: Float[np.ndarray, "points 3"] = images[:, :3] / images[:, 3:]
        return grid

    def cell_centers(self, cells: int) -> Float[np.ndarray, "centers 3"]:
        """Returns where the middles of cells x cells x cells of the grid are, x slowest."""
        axis = (np.arange(cells) + 0.5) * (2 / cells) - 1
        grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
        return self.to_world(grid.reshape(-1, 3))

    def within(self, bounds: "Bounds") -> "Space":
        """Returns the space whose grid is a part of this one's."""
        lower, upper = np.array(bounds.lower), np.array(bounds.upper)
        half = (upper - lower) / 2
        part_from_grid = np.eye(4)
        part_from_grid[:3, :3] = np.diag(1 / half)
        part_from_grid[:3, 3] = -(lower + upper) / 2 / half
        x, y, z = np.array(self.axis_lengths) * half
        return replace(
            self, grid_from_world=part_from_grid @ self.grid_from_world, axis_lengths=(x, y, z)
        )

    def to_world(self, points_grid: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, "points 3"]:
        """Returns the points of the normalized world; NaN where nothing is mapped to the grid."""
        homogeneous = np.hstack([points_grid, np.ones((len(points_grid), 1))])
        result = np.full_like(points_grid, np.nan)
        for matrix in self.grid_from_world:
            world = homogeneous @ np.linalg.inv(matrix).T
            world = world[:, :3] / world[:, 3:]
            there = np.abs(self.to_grid(world) - points_grid).max(axis=1) < 1e-6
            result[there] = world[there]
        return result


@dataclass(frozen=True, slots=True)
class Bounds:
    """A part of a grid, from `lower` to `upper` in its coordinates; the whole by default."""

    lower: tuple[float, float, float] = (-1.0, -1.0, -1.0)
    upper: tuple[float, float, float] = (1.0, 1.0, 1.0)
