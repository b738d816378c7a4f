"""The share of the photographs' pixels that a box around the points can explain.

Each photograph is cut into tiles. A box explains a tile that shows more points within the box than
outside it, or shows none while a tile beside it does. It also explains flat tiles of the one color
that those of all photographs have in the median, as the white around a cut-out object: behind a box
there is one color. Textured ground, clouds and rooms without points are neither, and need a space
that reaches to them.
"""

from collections.abc import Iterable, Sequence

import cv2
import numpy as np
from jaxtyping import Bool, Float

from styletrf.box import whole_box
from styletrf.cameras import Camera
from styletrf.point_table import SparsePoints
from styletrf.surroundings import surroundings

Image = Float[np.ndarray, "height width 3"]

LONG_SIDE_PX = 504  # of the views that the scene is surveyed with
TILES = 16  # along an image's longer side
_FLAT = 0.03  # standard deviation of a color within a tile, and from that of the ground


def explained_pixels(
    images: Iterable[Image],
    cameras: Sequence[Camera],
    points: SparsePoints,
) -> float:
    """Returns the share of the tiles of all photographs that the box explains, from 0 to 1.

    The box is the one that the scene would get, `styletrf.box.whole_box`.

    Args:
        images: Of the cameras, RGB in [0, 1], at their size.
        cameras: In the order in which `points` counts images.
        points: With their tracks.

    Raises:
        InputError: No photograph sees any of the points.
    """
    scene = surroundings(cameras, points.xyz_world, LONG_SIDE_PX)
    box = whole_box(scene)
    inside = (np.abs(scene.points - box.center) <= box.half).all(axis=1)
    shown, flat, colors = [], [], []
    for k, (camera, image) in enumerate(zip(cameras, images, strict=True)):
        of_image = points.observed_image == k
        pixels = points.observed_pixel[of_image]
        shown.append(_shows(camera, pixels, inside[points.observed_point[of_image]]))
        mean, deviation = _tiled(image, shown[-1].shape)
        colors.append(mean)
        flat.append(deviation < _FLAT)
    all_shown, all_flat = _joined(shown), _joined(flat)
    all_colors = np.concatenate([color.reshape(-1, 3) for color in colors])
    ground = all_flat & ~all_shown
    if ground.any():
        middle = np.median(all_colors[ground], axis=0)
        ground &= np.abs(all_colors - middle).max(axis=1) < _FLAT
    return float((all_shown | ground).mean())


def _joined(parts: Sequence[Bool[np.ndarray, "rows columns"]]) -> Bool[np.ndarray, " tiles"]:
    return np.concatenate([part.ravel() for part in parts])


def _shows(
    camera: Camera, pixels: Float[np.ndarray, "points 2"], inside: Bool[np.ndarray, " points"]
) -> Bool[np.ndarray, "rows columns"]:
    """Returns which tiles show more points of the box than others, or none but those beside do."""
    longer = max(camera.width, camera.height)
    rows = max(1, round(TILES * camera.height / longer))
    columns = max(1, round(TILES * camera.width / longer))
    row = np.clip(pixels[:, 1] * rows // camera.height, 0, rows - 1).astype(np.int64)
    column = np.clip(pixels[:, 0] * columns // camera.width, 0, columns - 1).astype(np.int64)
    votes = np.zeros((rows, columns), np.float32)
    np.add.at(votes, (row, column), np.where(inside, 1.0, -1.0))
    beside = cv2.dilate(votes, np.ones((3, 3)))
    return np.asarray(np.where(votes == 0, beside > 0, votes > 0))


def _tiled(
    image: Image, shape: tuple[int, ...]
) -> tuple[Float[np.ndarray, "rows columns 3"], Float[np.ndarray, "rows columns"]]:
    """Returns the mean color of each tile, and the largest deviation of its channels."""
    size = (shape[1], shape[0])
    mean = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    square = cv2.resize(image**2, size, interpolation=cv2.INTER_AREA)
    deviation = np.sqrt(np.maximum(square - mean**2, 0)).max(axis=2)
    return mean, deviation
