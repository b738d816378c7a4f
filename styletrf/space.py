"""How the normalised world maps to the grid the field lives in, and cameras to segments of it.

Both kinds of space are one 4x4 projective map, `grid_from_world`: affine for a box, perspective for
NDC (Mildenhall et al. 2020, appendix C). Straight rays stay straight, so a pixel's ray is a segment
of the grid; it is clipped to [-1, 1]^3 in homogeneous coordinates, where each face is one linear
inequality in the depth Z.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.cameras import Camera
from styletrf.kernels.samples import Segments


@dataclass(frozen=True, slots=True)
class Space:
    """The map to grid coordinates and the metric of optical length.

    `axis_lengths` are the lengths of the grid's axes in units of optical length: half extents of
    the box in the normalised world, or 1 for NDC, whose own coordinates measure it.
    """

    kind: Literal["ndc", "box"]
    grid_from_world: Float[np.ndarray, "4 4"]
    axis_lengths: tuple[float, float, float]
    depth_min: float

    def to_grid(self, points_world: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, "points 3"]:
        """Returns grid coordinates of points of the normalised world, in front of all cameras."""
        homogeneous = points_world @ self.grid_from_world[:, :3].T + self.grid_from_world[:, 3]
        grid: Float[np.ndarray, "points 3"] = homogeneous[:, :3] / homogeneous[:, 3:]
        return grid


class ViewRays:
    """Segments through pixels of a set of cameras, drawn by (view, pixel) and never stored.

    For each view the homogeneous grid point at depth Z through pixel (x, y) is
    `start + Z * slope @ (x, y, 1)`.
    """

    def __init__(
        self, cameras: Sequence[Camera], space: Space, step: float, device: torch.device
    ) -> None:
        matrix = space.grid_from_world
        starts, slopes, directions = [], [], []
        for camera in cameras:
            directions_world = camera.world_from_camera[:, :3] @ _unprojection(camera)
            starts.append(matrix[:, :3] @ camera.center_world + matrix[:, 3])
            slopes.append(matrix[:, :3] @ directions_world)
            directions.append(directions_world)
        self._starts = torch.as_tensor(np.stack(starts), device=device)
        self._slopes = torch.as_tensor(np.stack(slopes), device=device)
        self._directions = torch.as_tensor(np.stack(directions), device=device)
        self._axis_lengths = torch.tensor(space.axis_lengths, dtype=torch.float64, device=device)
        self._depth_min, self._step = space.depth_min, step

    def segments(self, view: Int64[Tensor, " rays"], pixels: Float[Tensor, "rays 2"]) -> Segments:
        """Returns the float32 segments through `pixels` of the views, at most `step` a step."""
        ones = torch.ones_like(pixels[:, :1])
        points = torch.cat([pixels, ones], dim=-1).to(self._starts)[..., None]
        start, slope = self._starts[view], (self._slopes[view] @ points)[..., 0]
        near, far = _clip(start, slope, self._depth_min)
        hit = near < far
        near, far = torch.where(hit, near, 1.0), torch.where(hit, far, 2.0)
        first, last = start + near[:, None] * slope, start + far[:, None] * slope
        safe_first = torch.where(hit, first[:, 3], 1.0)
        safe_last = torch.where(hit, last[:, 3], 1.0)
        origin = first[:, :3] / safe_first[:, None]
        direction = last[:, :3] / safe_last[:, None] - origin
        length = (direction * self._axis_lengths).norm(dim=-1)
        n_steps = torch.where(hit, torch.ceil(length / self._step), 0.0).long()
        view_direction = (self._directions[view] @ points)[..., 0]
        view_direction = view_direction / view_direction.norm(dim=-1, keepdim=True)
        return Segments(
            origins=origin.float(),
            directions=direction.float(),
            lengths=length.float(),
            n_steps=n_steps,
            view_directions=view_direction.float(),
            depth_near=near.float(),
            depth_far=far.float(),
            depth_bend=(safe_last / safe_first).float(),
        )


def _unprojection(camera: Camera) -> Float[np.ndarray, "3 3"]:
    """Camera direction with z = 1 from homogeneous pixels."""
    return np.array(
        [
            [1 / camera.fx, 0, -camera.cx / camera.fx],
            [0, 1 / camera.fy, -camera.cy / camera.fy],
            [0, 0, 1],
        ]
    )


def _clip(
    start: Float[Tensor, "rays 4"], slope: Float[Tensor, "rays 4"], depth_min: float
) -> tuple[Float[Tensor, " rays"], Float[Tensor, " rays"]]:
    """Returns the depths between which the ray is inside; near >= far where it misses.

    Inside means w + x_i >= 0 and w - x_i >= 0 for each axis i.
    """
    signs = torch.cat([torch.eye(3), -torch.eye(3)]).to(start)
    a = start[:, 3:] + start[:, :3] @ signs.T
    b = slope[:, 3:] + slope[:, :3] @ signs.T
    root = -a / torch.where(b == 0, 1.0, b)
    infinity = torch.full_like(a, torch.inf)
    lower = torch.where(b > 0, root, -infinity)
    upper = torch.where(b < 0, root, infinity)
    outside = (b == 0) & (a < 0)
    near = lower.amax(dim=1).clamp(min=depth_min)
    far = torch.where(outside.any(dim=1), -torch.inf, upper.amin(dim=1))
    return near, far
