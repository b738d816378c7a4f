"""Which few views show all that the trajectory will: greedy cover by the field's own depth.

What no prior shows keeps the photographs' colors, or what the factors make up; a second and a
third prior of the same place average out what the painter does differently from view to view.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from styletrf.geometry.cameras import (
    Camera,
    depth_behind,
    fitted_to,
    pixel_centers,
    points_at_depth,
)

Depth = Float[np.ndarray, "height width"]


@dataclass(frozen=True, slots=True)
class CoverageConfig:
    """How well views cover what a path sees."""

    count: int = 0  # of views; 0: as many as the cover needs
    times: int = 3  # a place is covered that so many views show
    share: float = 0.95  # of the places that any of the candidates shows
    depth_px: int = 128  # longer side of the depth that decides visibility
    tolerance: float = 0.1  # of the depth, within which a view shows a place
    most_hidden: float = 0.02  # of the places, that no candidate shows

    def __post_init__(self) -> None:
        if self.count < 0 or self.times < 1 or not 0 < self.share <= 1:
            raise ValueError(f"no such cover: {self}")


def small_camera(camera: Camera, config: CoverageConfig) -> Camera:
    """Returns the camera at the size that decides visibility."""
    return fitted_to(camera, config.depth_px)


def places_seen(
    cameras: Sequence[Camera], depths: Sequence[Depth], every: int = 1
) -> Float[np.ndarray, "places 3"]:
    """Returns the world points behind every n-th pixel, where it hits something."""
    places = []
    for camera, depth in zip(cameras, depths, strict=True):
        pixels = pixel_centers(camera.width, camera.height)[::every]
        flat = depth.reshape(-1)[::every].astype(np.float64)
        hit = np.isfinite(flat)
        places.append(points_at_depth(camera, pixels[hit], flat[hit]))
    return np.concatenate(places)


def shown(
    camera: Camera, depth: Depth, places: Float[np.ndarray, "places 3"], tolerance: float
) -> Bool[np.ndarray, " places"]:
    """Returns which places a view shows: inside of it, and at the depth that it has there."""
    _, depth_there, found, inside = depth_behind(camera, depth, places)
    near = np.abs(np.where(np.isfinite(found), found, 0) - depth_there) <= tolerance * depth_there
    visible: Bool[np.ndarray, " places"] = inside & near
    return visible


def covering(seen: Bool[np.ndarray, "views places"], config: CoverageConfig) -> list[int]:
    """Returns the chosen views: each next one shows most of what is not covered yet.

    Greedy set cover: each place should be visible in `times` views, or in all candidates that
    see it if there are fewer. A `count` above 0 selects exactly so many views.
    """
    wanted = np.minimum(seen.sum(axis=0), config.times)
    total, missing = wanted.sum(), wanted.copy()
    chosen: list[int] = []
    most = min(config.count, len(seen)) if config.count else len(seen)
    while len(chosen) < most:
        if config.count and missing.sum() <= 0:  # covered: the others cover it once more
            rest = [k for k in range(len(seen)) if k not in chosen]
            missing = np.minimum(seen[rest].sum(axis=0), config.times)
        gains = (seen & (missing > 0)).sum(axis=1)
        gains[chosen] = -1
        if not config.count and missing.sum() <= (1 - config.share) * total and chosen:
            break
        chosen.append(int(gains.argmax()))
        missing -= seen[chosen[-1]] & (missing > 0)
    return sorted(chosen)
