"""Rays from pixels of cameras through the grid of the field, as chains of straight pieces.

Each piece is clipped to [-1, 1]^3 and to its map's part of the world (`styletrf.geometry.space`) in
homogeneous coordinates, where both are linear in the depth Z.
"""

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.field.kernels.samples import RaySegments
from styletrf.finiteness import require_finite
from styletrf.geometry.cameras import Camera, camera_numbers
from styletrf.geometry.space import Space


class ViewRays:
    """Rays through pixels of a set of cameras, drawn by (view, pixel) and never stored.

    For each view and map the homogeneous grid point at depth Z through pixel (x, y) is
    `start + Z * slope @ (x, y, 1)`.

    Raises:
        NotFiniteError: A camera or a map is not finite; its rays would count as missing the grid.
    """

    def __init__(
        self, cameras: Sequence[Camera], space: Space, step: float, device: torch.device
    ) -> None:
        matrices = space.grid_from_world
        named = [("the map to the grid", matrices), *map(camera_numbers, cameras)]
        require_finite("rays", f"in space {space.kind}", named)
        starts, slopes, directions = [], [], []
        for camera in cameras:
            directions_world = camera.world_from_camera[:, :3] @ _unprojection(camera)
            starts.append(matrices[..., :3] @ camera.center_world + matrices[..., 3])
            slopes.append(matrices[..., :3] @ directions_world)
            directions.append(directions_world)
        self._starts = torch.as_tensor(np.stack(starts), device=device)
        self._slopes = torch.as_tensor(np.stack(slopes), device=device)
        self._directions = torch.as_tensor(np.stack(directions), device=device)
        self._axis_lengths = torch.tensor(space.axis_lengths, dtype=torch.float64, device=device)
        self._depth_min, self._step = space.depth_min, step

    def segments(
        self, view: Int64[Tensor, " rays"] | int, pixels: Float[Tensor, "rays 2"]
    ) -> RaySegments:
        """Returns the float32 rays through `pixels`, of one view or each its own.

        They are cut into steps of at most the length that the set was made for.
        """
        ones = torch.ones_like(pixels[:, :1])
        points = torch.cat([pixels, ones], dim=-1).to(self._starts)[..., None]
        slope = (self._slopes[view] @ points[:, None])[..., 0]
        start = self._starts[view].expand_as(slope)
        near, far = _clip(start, slope, self._depth_min)
        start, slope, near, far = _in_order(start, slope, near, far)
        hit = near < far
        near, far = torch.where(hit, near, 1.0), torch.where(hit, far, 2.0)
        first, last = start + near[..., None] * slope, start + far[..., None] * slope
        safe_first = torch.where(hit, first[..., 3], 1.0)
        safe_last = torch.where(hit, last[..., 3], 1.0)
        origin = first[..., :3] / safe_first[..., None]
        direction = last[..., :3] / safe_last[..., None] - origin
        lengths = torch.where(hit, (direction * self._axis_lengths).norm(dim=-1), 0.0)
        origin, direction, ends = _by_fraction(origin, direction, lengths)
        length = lengths.sum(dim=1)
        view_direction = (self._directions[view] @ points)[..., 0]
        view_direction = view_direction / view_direction.norm(dim=-1, keepdim=True)
        return RaySegments(
            origins=origin.float(),
            directions=direction.float(),
            ends=ends.float(),
            lengths=length.float(),
            n_steps=torch.ceil(length / self._step).long(),
            view_directions=view_direction.float(),
            depth_near=near.float(),
            depth_far=far.float(),
            depth_bend=(safe_last / safe_first).float(),
        )


def _unprojection(camera: Camera) -> Float[np.ndarray, "3 3"]:
    """Returns the matrix from homogeneous pixels to camera directions with z = 1."""
    return np.array(
        [
            [1 / camera.fx, 0, -camera.cx / camera.fx],
            [0, 1 / camera.fy, -camera.cy / camera.fy],
            [0, 0, 1],
        ]
    )


def _clip(
    start: Float[Tensor, "rays maps 4"], slope: Float[Tensor, "rays maps 4"], depth_min: float
) -> tuple[Float[Tensor, "rays maps"], Float[Tensor, "rays maps"]]:
    """Returns the depths between which a map holds the ray; near >= far where it never does.

    A map holds a point where w + x_i >= 0 and w - x_i >= 0 for each axis i, and w >= w' of every
    other map.
    """
    a, b = _inequalities(start), _inequalities(slope)
    root = -a / torch.where(b == 0, 1.0, b)
    infinity = torch.full_like(a, torch.inf)
    lower = torch.where(b > 0, root, -infinity)
    upper = torch.where(b < 0, root, infinity)
    outside = (b == 0) & (a < 0)
    near = lower.amax(dim=-1).clamp(min=depth_min)
    far = torch.where(outside.any(dim=-1), -torch.inf, upper.amin(dim=-1))
    return near, far


def _inequalities(point: Float[Tensor, "rays maps 4"]) -> Float[Tensor, "rays maps sides"]:
    x, w = point[..., :3], point[..., 3:]
    over_others = [w - w.transpose(1, 2)] if w.shape[1] > 1 else []
    return torch.cat([w + x, w - x, *over_others], dim=-1)


def _in_order(
    start: Float[Tensor, "rays maps 4"],
    slope: Float[Tensor, "rays maps 4"],
    near: Float[Tensor, "rays maps"],
    far: Float[Tensor, "rays maps"],
) -> tuple[
    Float[Tensor, "rays pieces 4"], Float[Tensor, "rays pieces 4"],
    Float[Tensor, "rays pieces"], Float[Tensor, "rays pieces"],
]:  # fmt: skip
    """Returns the pieces along the rays: those that hold some of the ray first, by depth."""
    if near.shape[1] == 1:
        return start, slope, near, far
    hit = near < far
    most = max(1, int(hit.sum(dim=1).max()) if len(hit) else 1)
    order = torch.where(hit, near, torch.inf).argsort(dim=1)[:, :most]
    ray = torch.arange(len(order), device=order.device)[:, None]
    return start[ray, order], slope[ray, order], near[ray, order], far[ray, order]


def _by_fraction(
    origin: Float[Tensor, "rays pieces 3"],
    direction: Float[Tensor, "rays pieces 3"],
    lengths: Float[Tensor, "rays pieces"],
) -> tuple[
    Float[Tensor, "rays pieces 3"], Float[Tensor, "rays pieces 3"], Float[Tensor, "rays pieces"]
]:
    """Returns the lines by the fraction of the ray's length instead of each line's, and their ends.

    All directions are then of the ray's whole length: short pieces lose no precision.
    """
    if lengths.shape[1] == 1:
        return origin, direction, torch.ones_like(lengths)
    total = lengths.sum(dim=1, keepdim=True)
    fraction = lengths / torch.where(total > 0, total, 1.0)
    ends = fraction.cumsum(dim=1)
    last = ends >= ends[:, -1:]
    starts = ends - fraction
    direction = direction / torch.where(fraction > 0, fraction, 1.0)[..., None]
    origin = origin - starts[..., None] * direction
    return origin, direction, torch.where(last, 1.0, ends)
