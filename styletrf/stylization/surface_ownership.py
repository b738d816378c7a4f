"""Assigns each surface point to one of the priors that show it, whose strokes it gets.

Priors are stylized one by one, and their strokes disagree. An appearance fitted to all of them
averages the strokes away. As in texturing a mesh from photographs (Lempitsky and Ivanov 2007), each
point of the surface learns from one view only: the first, in farthest-first order, that shows it.

A view shows the point of another view's pixel p if p, moved there by its own depth and back by the
depth found there, returns to the neighborhood of p (the usual test of multi-view stereo, but with a
wider tolerance: where density is spread along the rays, its depth depends on the view, and owners
that alternate there leave speckles). A hidden point lies far from the surface that hides it, and
does not return.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int64

from styletrf.geometry.cameras import (
    Camera,
    depth_behind,
    finite_depth,
    pixel_centers,
    points_at_depth,
    project,
)

Depth = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]


@dataclass(frozen=True, slots=True)
class OwnershipConfig:
    """When two pixels show the same, and which regions are too small to own pixels."""

    tolerance: float = 0.016  # of the longer side, between a pixel and its return
    smallest: float = 1e-3  # fraction of a view's pixels that a connected region needs

    def __post_init__(self) -> None:
        if self.tolerance <= 0 or not 0 <= self.smallest < 1:
            raise ValueError(f"tolerance is above 0, smallest in [0, 1), not {self}")


def farthest_first(cameras: Sequence[Camera]) -> list[int]:
    """Returns the indices of cameras: the most central one, then always the one farthest from all.

    (Gonzalez 1985.) Ties go to the lower index.
    """
    centers = np.array([camera.center_world for camera in cameras])
    chosen = [int(np.linalg.norm(centers - centers.mean(axis=0), axis=1).argmin())]
    nearest = np.linalg.norm(centers - centers[chosen[0]], axis=1)
    while len(chosen) < len(cameras):
        nearest[chosen] = -1
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(centers - centers[chosen[-1]], axis=1))
    return chosen


def owned_pixels(
    cameras: Sequence[Camera], depths: Sequence[Depth], config: OwnershipConfig
) -> list[Mask]:
    """Returns, view by view, the pixels whose surface no earlier view in `farthest_first` shows.

    The first view owns all of its pixels. Every pixel of any view is owned or shown by an owner,
    but for regions smaller than `smallest`.

    Args:
        cameras: The cameras of the views.
        depths: The depths along the cameras' z axes; infinite where nothing is hit.
        config: The tolerances.
    """
    masks: list[Mask] = [np.zeros(depth.shape, dtype=bool) for depth in depths]
    done: list[int] = []
    for view in farthest_first(cameras):
        unseen = np.arange(depths[view].size)
        for other in done:
            views = (cameras[view], cameras[other]), (depths[view], depths[other])
            tolerance_px = config.tolerance * max(depths[view].shape)
            unseen = unseen[~is_shown(*views, unseen, tolerance_px)]
        masks[view].reshape(-1)[unseen] = True
        masks[view] = _without_specks(masks[view], config.smallest)
        done.append(view)
    return masks


def is_shown(
    cameras: tuple[Camera, Camera],
    depths: tuple[Depth, Depth],
    pixels: Int64[np.ndarray, " pixels"],
    tolerance_px: float,
) -> Bool[np.ndarray, " pixels"]:
    """Returns which pixels of the first view show points that the second view shows, too.

    Args:
        cameras: The first and the second camera.
        depths: The depths of both views.
        pixels: Indices into the first view, row by row.
        tolerance_px: How far from itself a pixel may return.
    """
    first, second = cameras
    centers = pixel_centers(first.width, first.height)[pixels]
    points_world = points_at_depth(first, centers, finite_depth(depths[0].reshape(-1)[pixels]))
    there, _, found, inside = depth_behind(second, depths[1], points_world)
    found_world = points_at_depth(second, there, finite_depth(found))
    back, _ = project(first, found_world)
    shown: Bool[np.ndarray, " pixels"] = inside & (
        np.square(back - centers).sum(axis=1) <= tolerance_px**2
    )
    return shown


def _without_specks(mask: Mask, smallest: float) -> Mask:
    """Returns the mask with small holes closed, and without its small connected regions."""
    closed = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(closed, connectivity=4)
    is_large = statistics[:, cv2.CC_STAT_AREA] >= smallest * mask.size
    is_large[0] = False  # all that is not in the mask
    return np.asarray(is_large[labels], dtype=bool)
