"""Chooses the resolution of a style's lattice by how densely the priors sample the surfaces.

Strokes are as fine as the pixels of the priors. A lattice that suffices for the photographs'
colors shows them blurred where a camera is near: in a box the lattice is as fine everywhere, and
pixels are not. So the appearance gets lattice points by the pixel, not by the scene. The pixels of
the priors do not determine a lattice that is finer than they are, and larger frames show its noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from styletrf.geometry.cameras import Camera, pixel_centers, points_at_depth
from styletrf.geometry.space import Space

_STRIDE_PX = 8  # of the pixels that are looked at, in both directions


@dataclass(frozen=True, slots=True)
class StyleLatticeConfig:
    """The lattice points for each pixel of the priors, and the largest size of the lattice.

    Attributes:
        points_per_px: The lattice points per pixel along a line of a prior, at the depth that it
            shows.
        share: The largest fraction of the places looked at that may have fewer.
        min_scale: The least scale of the style's lattice over the field's, however far cameras are.
        max_scale: The greatest scale, however near they are.
        most_points_per_px: The scale is reduced, but not below 1, where a pixel would have more.
    """

    points_per_px: float = 0.65
    share: float = 0.25
    min_scale: float = 1.5
    max_scale: float = 2.0
    most_points_per_px: float = 1.1

    def __post_init__(self) -> None:
        ordered = 0 < self.min_scale <= self.max_scale
        points_ordered = 0 < self.points_per_px <= self.most_points_per_px
        if not (points_ordered and 0 <= self.share <= 1 and ordered):
            raise ValueError(
                "points_per_px is above 0 and at most most_points_per_px, share in [0, 1],"
                f" min_scale above 0 and at most max_scale, not {self}"
            )


def lattice_scale(
    space: Space,
    resolution: Sequence[int],
    cameras: Sequence[Camera],
    depths: Sequence[Float[np.ndarray, "height width"]],
    config: StyleLatticeConfig,
) -> float:
    """Returns how many times finer than `resolution` the lattice of a style is.

    The scale lies between those of `config`, and is the smaller one where no prior shows anything.
    Where pixels would have more points than `most_points_per_px`, it is reduced, but not below 1.

    Args:
        space: The space of the part of the grid that the lattice fills (`Space.within`).
        resolution: The lattice points along the axes of that part.
        cameras: The cameras of the priors, in the normalized world.
        depths: The priors' depths along the cameras' axes; infinite where nothing is hit.
        config: The wanted density and the bounds.
    """
    views = zip(cameras, depths, strict=True)
    found = np.concatenate([points_per_pixel(space, resolution, *view) for view in views])
    if len(found) == 0:
        return config.min_scale
    sampled = max(float(np.quantile(found, config.share)), 1e-9)
    scale = float(np.clip(config.points_per_px / sampled, config.min_scale, config.max_scale))
    return min(scale, max(1.0, config.most_points_per_px / sampled))


def points_per_pixel(
    space: Space,
    resolution: Sequence[int],
    camera: Camera,
    depth: Float[np.ndarray, "height width"],
) -> Float[np.ndarray, " places"]:
    """Returns the lattice points in the width of a pixel, for every eighth pixel each way.

    This is the smallest singular value of the derivative of the lattice coordinates by the position
    in the image, on a plane across the view at the depth of the pixel: along the direction in which
    the lattice is coarsest. On a slanted surface there are more. Pixels of infinite depth, in which
    nothing is hit, are left out.
    """
    rows, columns = np.indices(depth.shape)
    looked_at = (rows % _STRIDE_PX == 0) & (columns % _STRIDE_PX == 0)
    looked_at &= np.isfinite(depth) & (depth > 0)
    pixels = pixel_centers(camera.width, camera.height)[looked_at.reshape(-1)]
    depths = depth[looked_at].astype(np.float64)
    cells = (np.asarray(resolution) - 1) / 2  # the grid reaches from -1 to 1

    def lattice(step_px: tuple[float, float]) -> Float[np.ndarray, "pixels 3"]:
        points_world = points_at_depth(camera, pixels + np.array(step_px), depths)
        found: Float[np.ndarray, "pixels 3"] = space.to_grid(points_world) * cells
        return found

    along_x = lattice((0.5, 0.0)) - lattice((-0.5, 0.0))
    along_y = lattice((0.0, 0.5)) - lattice((0.0, -0.5))
    derivatives = np.stack([along_x, along_y], axis=-1)
    derivatives = derivatives[np.isfinite(derivatives).all(axis=(1, 2))]
    smallest: Float[np.ndarray, " places"] = np.linalg.svd(derivatives, compute_uv=False)[:, 1]
    return smallest
