"""Parts of a scene: a box, or the surfaces that a mask on one view shows."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float

from styletrf.capture.masks import read_mask_image
from styletrf.errors import InputError
from styletrf.files.float_images import read_float_image
from styletrf.files.images import from_integers
from styletrf.geometry.camera_table import read_cameras
from styletrf.geometry.cameras import Camera, depth_behind
from styletrf.geometry.image_sampling import sample_at

_MOST_STRETCH = 0.01
"""The proportions of a mask may differ by this fraction from those of its view, or by a pixel."""


class Region(ABC):
    """A part of the normalized world."""

    @abstractmethod
    def inside(self, points_world: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, " points"]:
        """Returns 1 for points inside, 0 for points outside, values between at a soft border."""


@dataclass(frozen=True, slots=True)
class Box(Region):
    """An axis-parallel box."""

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]

    def __post_init__(self) -> None:
        if not all(a < b for a, b in zip(self.lower, self.upper, strict=True)):
            raise ValueError(f"a box from {self.lower} to {self.upper} holds nothing")

    def inside(self, points_world: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, " points"]:
        """See `Region.inside`; NaN, a point of no place, is outside."""
        inside = (points_world >= self.lower) & (points_world <= self.upper)
        return np.asarray(inside.all(axis=1), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Masked(Region):
    """The surfaces that a view shows within its mask, without those hidden behind them.

    Attributes:
        camera: The camera of the view.
        mask: The weights of its pixels, from 0 to 1.
        depth: The depth along the camera's axis, infinite where nothing is hit.
        thickness: A point belongs to a surface up to this fraction of its depth behind it.
    """

    camera: Camera
    mask: Float[np.ndarray, "height width"]
    depth: Float[np.ndarray, "height width"]
    thickness: float = 0.05

    def inside(self, points_world: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, " points"]:
        """See `Region.inside`; points that the view does not show are outside."""
        somewhere = np.isfinite(points_world).all(axis=1)
        pixels, depth, surface, shown = depth_behind(
            self.camera,
            self.depth,
            np.where(somewhere[:, None], points_world, self.camera.center_world),
        )
        near = shown & (depth <= (1 + self.thickness) * surface)
        result = np.zeros(len(points_world))
        result[near] = sample_at(self.mask, pixels[near] - 0.5)
        return result


def masked_on(renders: Path, view: str, mask: Path) -> Masked:
    """Returns the region that an image shows white over one of the renders in a folder.

    Args:
        renders: The folder that `write_float_frames` wrote.
        view: The name of one of them.
        mask: An image of any size and the view's proportions, which may be 1 % or a pixel off;
            its transparent parts are black.

    Raises:
        InputError: There is no such view, or the mask is no image, of other proportions, or all
            black.
    """
    cameras = {camera.name: camera for camera in read_cameras(renders / "cameras.parquet")}
    if view not in cameras:
        known = f"{min(cameras)} to {max(cameras)}"
        raise InputError(f"--region, view {view}", "there is no such prior", f"Give one of {known}")
    camera = cameras[view]
    white = from_integers(read_mask_image(mask)).mean(axis=2)
    _require_proportions(mask, white.shape, camera)
    white = cv2.resize(white, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    if white.max() < 1 / 255:
        problem = "is all black or transparent"
        raise InputError(f"--region, mask {mask}", problem, "Paint white what to style")
    return Masked(camera, white, read_float_image(renders / "frames" / f"{view}.exr").depth)


def _require_proportions(mask: Path, shape: tuple[int, ...], camera: Camera) -> None:
    """Refuses a mask that would be stretched over its view: it would style other surfaces."""
    height, width = shape
    expected = width * camera.height / camera.width
    if abs(height - expected) > max(1.0, _MOST_STRETCH * expected):
        raise InputError(
            f"--region, mask {mask}",
            f"is {width}x{height}, and view {camera.name} {camera.width}x{camera.height}",
            "Paint it over the picture of the view, or give it the same proportions",
        )
