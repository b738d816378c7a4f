"""A scene's photographs as tensors, and which of them are held out."""

from collections.abc import Hashable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import cv2
import numpy as np
import torch
from jaxtyping import Float

from styletrf.capture.masks import mask_of_view
from styletrf.capture.poses.given_poses import GivenView
from styletrf.capture.view_images import Image
from styletrf.files.images import read_rgb, to_integers
from styletrf.geometry.cameras import Camera

CPU = torch.device("cpu")
_ALL_OF_A_PIXEL = 0.999
_ONE_PLACE = 1e-9  # of the extent of all centers: the rounding of the centers of one panorama
HOLD_OUT_EVERY = 8  # LLFF's protocol: views 0, 8, 16, ... of the sorted names
FEW_VIEWS = 12  # of fewer, each is worth much, and those at the ends most


def load_views(folder: Path, cameras: Sequence[Camera], device: torch.device = CPU) -> list[Image]:
    """Returns the cameras' images from `folder`, reduced to each camera's size by pixel area.

    They are RGB, or RGBA where a mask lies in `masks` beside the folder; alpha is then 0 where any
    part of the pixel is masked, else 255.
    """
    views = []
    for camera in cameras:
        image = to_integers(_sized(read_rgb(folder / f"{camera.name}.png"), camera))
        mask = mask_of_view(folder, camera.name)
        if mask is not None:
            counts = _sized(mask.astype(np.float32), camera) > _ALL_OF_A_PIXEL
            image = np.dstack([image, np.where(counts, 255, 0).astype(np.uint8)])
        views.append(torch.from_numpy(image).to(device))
    return views


def _sized(image: np.ndarray, camera: Camera) -> np.ndarray:
    size = (camera.width, camera.height)
    if image.shape[1::-1] == size:
        return image
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))


def held_out_names(
    cameras: Sequence[Camera],
    given: Mapping[str, GivenView],
    panoramas: Mapping[str, str] = MappingProxyType({}),
) -> set[str]:
    """Returns the names of the views to measure by: of a published split, or of `split_views`.

    The latter also decides if no view has a camera that the split holds out.

    Views of one panorama count as one, and are held out together: they have one center, and the
    margins of each show parts of the others.

    Args:
        cameras: The cameras of all views.
        given: The views whose poses came with them, by their names.
        panoramas: The names of the panoramas that views were cut from, by the names of the views.
    """
    published = {name for name, view in given.items() if view.held_out}
    if placed := {camera.name for camera in cameras if camera.name in published}:
        return placed
    sources = [panoramas.get(camera.name, camera.name) for camera in cameras]
    return {cameras[row].name for row in split_sources(sources)[1]}


def places_of(cameras: Sequence[Camera]) -> list[int]:
    """Returns the number of each view's place, counted in the order of the views.

    Views that are cut from one panorama share their center, and so a place. The memory is that of
    one view's distances, so that thousands of frames take none to speak of.
    """
    if not cameras:
        return []
    centers = np.stack([camera.center_world for camera in cameras])
    one_place = _ONE_PLACE * max(_distances(centers, k).max() for k in range(len(centers)))
    first = [int((_distances(centers, k) <= one_place).argmax()) for k in range(len(centers))]
    return [int(place) for place in np.unique(first, return_inverse=True)[1]]


def _distances(
    centers: Float[np.ndarray, "views 3"], from_view: int
) -> Float[np.ndarray, " views"]:
    distances: Float[np.ndarray, " views"] = np.linalg.norm(centers - centers[from_view], axis=1)
    return distances


def split_sources(sources: Sequence[Hashable]) -> tuple[list[int], list[int]]:
    """Returns the rows of the training views and of those held out, as `split_views` does.

    Views of one source, a panorama or a place, count as one and stay together.
    """
    distinct = list(dict.fromkeys(sources))
    held_out = {distinct[k] for k in split_views(len(distinct))[1]}
    is_held_out = [source in held_out for source in sources]
    rows = range(len(sources))
    return [k for k in rows if not is_held_out[k]], [k for k in rows if is_held_out[k]]


def split_views(n_views: int) -> tuple[list[int], list[int]]:
    """Returns the indices of the training views and of the views held out.

    Every eighth view from the first on is held out; of fewer than twelve, only the one in the
    middle.
    """
    is_few = n_views < FEW_VIEWS
    held_out = [n_views // 2][:n_views] if is_few else list(range(0, n_views, HOLD_OUT_EVERY))
    return [k for k in range(n_views) if k not in held_out], held_out
