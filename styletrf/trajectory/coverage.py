"""Chooses a few views that show all places that the trajectory will, by the field's own depth.

Places that no prior shows keep the photographs' colors, or arbitrary ones of the factors; a second
and a third prior of the same place average out the painter's differences from view to view.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int64

from styletrf.configuration import require_at_least, require_within
from styletrf.geometry.cameras import (
    Camera,
    depth_behind,
    fitted_to,
    points_at_depth,
)

Depth = Float[np.ndarray, "height width"]
_STEPS = 0.7548776662466927, 0.5698402909980532
"""Their multiples, modulo 1, fill a square evenly (R2, Roberts 2018)."""


@dataclass(frozen=True, slots=True)
class CoverageConfig:
    """Settings of the cover of the places that a path sees."""

    count: int = 0  # of views; 0: as many as the cover needs
    times: int = 3  # a place is covered that so many views show
    share: float = 0.95  # of the places that any of the candidates shows
    once: float = 0.998  # of the places, that at least one view shows; unused with a count
    depth_px: int = 128  # longer side of the depth that decides visibility
    tolerance: float = 0.1  # of the depth, within which a view shows a place
    most_hidden: float = 0.02  # of the places, that no candidate shows

    def __post_init__(self) -> None:
        require_at_least(0, self, "count")
        require_at_least(1, self, "times")
        require_within("(0, 1]", self, "share")
        require_within("[0, 1]", self, "once")
        require_at_least(16, self, "depth_px")  # fewer pixels miss what hides a place
        require_within("[0, inf)", self, "tolerance")


def small_camera(camera: Camera, config: CoverageConfig) -> Camera:
    """Returns the camera at the size that decides visibility."""
    return fitted_to(camera, config.depth_px)


def places_seen(
    cameras: Sequence[Camera], depths: Iterable[Depth], apart_px: float = 1.0
) -> Float[np.ndarray, "places 3"]:
    """Returns the world points behind pixels of a square grid, where they hit something.

    The grid begins elsewhere in each view: views of the same surface together show all of it.

    Args:
        cameras: The cameras of the views.
        depths: Their depths, which are used one at a time; infinite where a view hits nothing.
        apart_px: The distance between neighbors on the grid, at least 1.
    """
    places = []
    for k, (camera, depth) in enumerate(zip(cameras, depths, strict=True)):
        columns, rows = (
            _apart(side, apart_px, 0.5 + k * step)
            for side, step in zip((camera.width, camera.height), _STEPS, strict=True)
        )
        x, y = (part.ravel() for part in np.meshgrid(columns, rows))
        seen = depth[y, x].astype(np.float64)
        hit = np.isfinite(seen)
        places.append(points_at_depth(camera, np.column_stack([x, y])[hit] + 0.5, seen[hit]))
    return np.concatenate(places)


def _apart(side: int, apart_px: float, phase: float) -> Int64[np.ndarray, " pixels"]:
    """Returns pixels of a side that are so far apart, moved by a fraction (`phase`) of that."""
    passed = np.floor(np.arange(side + 1) / apart_px + phase)
    return np.flatnonzero(np.diff(passed))


def shown(
    camera: Camera,
    depth: Depth,
    places: Float[np.ndarray, "places 3"],
    tolerance: float,
    reach_px: int = 0,
) -> Bool[np.ndarray, " places"]:
    """Returns which places a view shows: inside of it, and at a depth that it has there.

    Args:
        camera: The camera of the view.
        depth: The depth of the view; infinite where it hits nothing.
        places: The places, in the camera's world.
        tolerance: The tolerance of the depth, as a fraction of it.
        reach_px: A place counts as shown if its depth lies within the range of depths up to so many
            pixels from it, so that the edges of a surface that hides it hide nothing more.
    """
    around = np.ones((2 * reach_px + 1, 2 * reach_px + 1), np.uint8)
    _, depth_there, nearest, inside = depth_behind(camera, cv2.erode(depth, around), places)
    _, _, farthest, _ = depth_behind(camera, cv2.dilate(depth, around), places)
    most = tolerance * depth_there
    visible: Bool[np.ndarray, " places"] = (
        inside & (nearest - depth_there <= most) & (depth_there - farthest <= most)
    )
    return visible


def covering(seen: Bool[np.ndarray, "views places"], config: CoverageConfig) -> list[int]:
    """Returns the chosen views: each next one shows most of the places not covered yet.

    This is a greedy set cover: each place should be visible in `times` views, or in all candidates
    that see it if there are fewer. A `count` above 0 selects exactly so many views.
    """
    if not config.count:
        return sorted(_covering(seen, [], config.times, config.share, len(seen)) or [0])
    chosen: list[int] = []
    most = min(config.count, len(seen))
    while len(chosen) < most:  # covered: the others cover it once more
        rest = seen.copy()
        rest[chosen] = False
        more = _covering(rest, [], config.times, 1.0, most - len(chosen))
        left = (k for k in range(len(seen)) if k not in chosen)
        chosen += more or [next(left)]
    return sorted(chosen)


def covering_once(
    seen: Bool[np.ndarray, "views places"], chosen: Sequence[int], config: CoverageConfig
) -> list[int]:
    """Returns the chosen views and others, until they show all but a few of the places once."""
    return sorted(_covering(seen, chosen, 1, config.once, len(seen)))


def _covering(
    seen: Bool[np.ndarray, "views places"],
    chosen: Sequence[int],
    times: int,
    share: float,
    most: int,
) -> list[int]:
    """Returns the chosen views and others, at most `most` in all.

    They suffice when the fraction `share` of the places is shown `times` times.
    """
    views = list(chosen)
    wanted = np.minimum(seen.sum(axis=0), times)
    missing = np.maximum(wanted - seen[views].sum(axis=0), 0)
    while len(views) < most and missing.sum() > (1 - share) * wanted.sum():
        gains = (seen & (missing > 0)).sum(axis=1)
        gains[views] = -1
        views.append(int(gains.argmax()))
        missing -= seen[views[-1]] & (missing > 0)
    return views
