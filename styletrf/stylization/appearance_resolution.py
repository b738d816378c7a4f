"""How fine a style's appearance has to be, decided from how the priors sample the surfaces.

Strokes are as fine as the pixels of the priors. A lattice that suffices for the photographs'
colors shows them blurred where a camera is near: in a box the lattice is as fine everywhere, and
pixels are not. So the appearance gets lattice points by the pixel, not by the scene.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from styletrf.geometry.cameras import Camera, pixel_centers, points_at_depth
from styletrf.geometry.space import Space

_STRIDE_PX = 8  # of the pixels that are looked at, in both directions


@dataclass(frozen=True, slots=True)
class AppearanceResolutionConfig:
    """The lattice points for each pixel of the priors, and what the lattice may grow to.

    Attributes:
        points_per_px: Along a line of the image, on a surface that the priors show.
        share: Of the surface, at most this part has fewer.
        max_scale: Of the style's lattice, times that of the field's.
    """

    points_per_px: float = 0.65
    share: float = 0.25
    max_scale: float = 2.0

    def __post_init__(self) -> None:
        if self.points_per_px <= 0 or not 0 <= self.share <= 1 or self.max_scale < 1:
            raise ValueError(
                f"points_per_px is above 0, share in [0, 1], max_scale at least 1, not {self}"
            )


def appearance_scale(
    space: Space,
    resolution: Sequence[int],
    cameras: Sequence[Camera],
    depths: Sequence[Float[np.ndarray, "height width"]],
    config: AppearanceResolutionConfig,
) -> float:
    """Returns how many times finer than `resolution` the lattice of a style is, from 1 up.

    Args:
        space: Of the lattice.
        resolution: Lattice points along the axes of its grid.
        cameras: Of the priors, in the normalized world.
        depths: Theirs along the cameras' axes; infinite where nothing is hit.
        config: What is wanted.
    """
    views = zip(cameras, depths, strict=True)
    found = np.concatenate([points_per_pixel(space, resolution, *view) for view in views])
    if len(found) == 0:
        return 1.0
    sampled = float(np.quantile(found, config.share))
    return float(np.clip(config.points_per_px / max(sampled, 1e-9), 1.0, config.max_scale))


def points_per_pixel(
    space: Space,
    resolution: Sequence[int],
    camera: Camera,
    depth: Float[np.ndarray, "height width"],
) -> Float[np.ndarray, " surface_pixels"]:
    """Returns the lattice points that a pixel's width covers, for every eighth pixel each way.

    The smallest singular value of the derivative of the lattice coordinates by the position in the
    image, at the depth of the pixel: of the direction in which the lattice is coarsest.
    """
    rows, columns = np.indices(depth.shape)
    looked_at = (rows % _STRIDE_PX == 0) & (columns % _STRIDE_PX == 0) & np.isfinite(depth)
    pixels = pixel_centers(camera.width, camera.height)[looked_at.reshape(-1)]
    depths = depth[looked_at].astype(np.float64)
    cells = (np.asarray(resolution) - 1) / 2  # the grid reaches from -1 to 1

    def lattice(step_px: tuple[float, float]) -> Float[np.ndarray, "pixels 3"]:
        points_world = points_at_depth(camera, pixels + np.array(step_px), depths)
        found: Float[np.ndarray, "pixels 3"] = space.to_grid(points_world) * cells
        return found

    along_x = lattice((0.5, 0.0)) - lattice((-0.5, 0.0))
    along_y = lattice((0.0, 0.5)) - lattice((0.0, -0.5))
    steps = np.linalg.svd(np.stack([along_x, along_y], axis=-1), compute_uv=False)
    smallest: Float[np.ndarray, " surface_pixels"] = steps[np.isfinite(steps).all(axis=1), 1]
    return smallest
