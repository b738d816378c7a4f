"""The fractions of the photographs' pixels that a box around the points can explain.

Each photograph is cut into tiles. A box explains a tile that shows more points within the box than
outside it, or shows none while a tile beside it does. It also explains flat tiles of the one color
that those of all photographs have in the median, as the white around a cut-out object: behind a box
there is one color. Textured ground, clouds and rooms without points are neither, and need a space
that reaches to them. Masked pixels do not count: a tile counts by the pixels that are left of it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float

from styletrf.geometry.cameras import Camera
from styletrf.geometry.point_table import SparsePoints
from styletrf.scene.box import whole_box
from styletrf.scene.upright_capture import upright_capture

Image = Float[np.ndarray, "height width 3"]
Mask = Bool[np.ndarray, "height width"]

LONG_SIDE_PX = 504  # of the views that the scene is surveyed with
TILES = 16  # along an image's longer side
_LEAST_GROUND = 0.1  # of all pixels, that a scene on a ground leaves to it
_NOTHING_ELSE = 0.9  # of the pixels around its points are ground
_FLAT = 0.03  # standard deviation of a color within a tile, and from that of the ground


@dataclass(frozen=True, slots=True)
class ExplainedPixels:
    """Fractions of the pixels of all photographs, from 0 to 1.

    Attributes:
        by_points: The fraction in tiles that show points of the box.
        by_ground: The fraction in other tiles, which are flat and have the one color of the ground.
    """

    by_points: float = 1.0
    by_ground: float = 0.0

    @property
    def by_box(self) -> float:
        """The fraction that the box explains."""
        return self.by_points + self.by_ground

    @property
    def is_cut_out(self) -> bool:
        """Whether the scene stands on the ground alone: nothing else is around its points."""
        around = 1 - self.by_points
        return self.by_ground >= max(_LEAST_GROUND, _NOTHING_ELSE * around)


def explained_pixels(
    images: Iterable[Image],
    cameras: Sequence[Camera],
    points: SparsePoints,
    masks: Iterable[Mask | None],
) -> ExplainedPixels:
    """Returns the fractions of the pixels of all photographs that the box explains.

    The box is the one that the scene would get, `styletrf.scene.box.whole_box`. Where no pixel
    counts, none speaks against it, and its points explain all.

    Args:
        images: The images of the cameras, RGB in [0, 1], at their size.
        cameras: The cameras, in the order in which `points` counts images.
        points: The points with their tracks.
        masks: Which pixels count, in the order of the images; None where all of an image do.

    Raises:
        InputError: No photograph sees any of the points.
    """
    scene = upright_capture(cameras, points.xyz_world, LONG_SIDE_PX)
    box = whole_box(scene)
    inside = (np.abs(scene.points - box.center) <= box.half).all(axis=1)
    shown, tiles = [], []
    for k, (camera, image, mask) in enumerate(zip(cameras, images, masks, strict=True)):
        of_image = points.observed_image == k
        pixels = points.observed_pixel[of_image]
        shown.append(_shows(camera, pixels, inside[points.observed_point[of_image]]))
        tiles.append(_tiled(image, mask, shown[-1].shape))
    is_shown = np.concatenate([part.ravel() for part in shown])
    color = np.concatenate([part.color.reshape(-1, 3) for part in tiles])
    deviation = np.concatenate([part.deviation.ravel() for part in tiles])
    counted = np.concatenate([part.counted.ravel() for part in tiles])
    if not counted.any():
        return ExplainedPixels()
    ground = _is_ground(color, (deviation < _FLAT) & ~is_shown & (counted > 0))
    by_points, by_ground = (float(np.average(part, weights=counted)) for part in (is_shown, ground))
    return ExplainedPixels(by_points, by_ground)


def _is_ground(
    color: Float[np.ndarray, "tiles 3"], flat: Bool[np.ndarray, " tiles"]
) -> Bool[np.ndarray, " tiles"]:
    """Returns which of the flat tiles have their median color."""
    if not flat.any():
        return flat
    away = np.abs(color - np.median(color[flat], axis=0)).max(axis=1)
    return np.asarray(flat & (away < _FLAT))


def _shows(
    camera: Camera, pixels: Float[np.ndarray, "points 2"], inside: Bool[np.ndarray, " points"]
) -> Bool[np.ndarray, "rows columns"]:
    """Returns the tiles in which points inside the box outnumber points outside it.

    A tile with a tie, such as an empty one, counts if a neighboring tile has such a majority.
    """
    longer = max(camera.width, camera.height)
    rows = max(1, round(TILES * camera.height / longer))
    columns = max(1, round(TILES * camera.width / longer))
    row = np.clip(pixels[:, 1] * rows // camera.height, 0, rows - 1).astype(np.int64)
    column = np.clip(pixels[:, 0] * columns // camera.width, 0, columns - 1).astype(np.int64)
    votes = np.zeros((rows, columns), np.float32)
    np.add.at(votes, (row, column), np.where(inside, 1.0, -1.0))
    beside = cv2.dilate(votes, np.ones((3, 3)))
    return np.asarray(np.where(votes == 0, beside > 0, votes > 0))


@dataclass(frozen=True, slots=True)
class _Tiles:
    """For each tile: the mean color, the largest deviation of a channel, the counted fraction."""

    color: Float[np.ndarray, "rows columns 3"]
    deviation: Float[np.ndarray, "rows columns"]
    counted: Float[np.ndarray, "rows columns"]


def _tiled(image: Image, mask: Mask | None, shape: tuple[int, ...]) -> _Tiles:
    """Returns the tiles of an image, by the pixels that count; all do without a mask."""
    counts = np.ones(image.shape[:2], np.float32) if mask is None else mask.astype(np.float32)

    def area_mean(values: np.ndarray) -> np.ndarray:
        return np.asarray(cv2.resize(values, shape[::-1], interpolation=cv2.INTER_AREA))

    counted = area_mean(counts)
    parts = np.maximum(counted, 1e-6)[..., None]
    color = area_mean(image * counts[..., None]) / parts
    square = area_mean(image**2 * counts[..., None]) / parts
    deviation = np.sqrt(np.maximum(square - color**2, 0)).max(axis=2)
    return _Tiles(color, deviation, counted)
