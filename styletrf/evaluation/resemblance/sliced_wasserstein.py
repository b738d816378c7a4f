"""Sliced Wasserstein distances between the colors and the textures of two pictures.

A picture becomes points: its pixels in CIE L*a*b* (3 coordinates), or its square patches of them
(147 coordinates for 7x7), with their mean colors or without. The points are projected onto random
directions of length 1; between the sorted projections of two pictures the Wasserstein distance has
a closed form (Rabin et al. 2012), and its root mean square over directions is the distance. Where
things are does not count, and no network is involved. All values are in units of L*a*b*, where 1 is
about the least visible step.

Patches differ mostly in their mean colors, which a map of colors alone can correct; it cannot paint
texture: the patches without their means.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float

from styletrf.configuration import SEEDS, require_within
from styletrf.errors import InputError

Picture = Float[np.ndarray, "_ _ 3"]
Points = Float[np.ndarray, "points coordinates"]
Patches = Float[np.ndarray, "patches 3 side side"]
Directions = Float[np.ndarray, "directions coordinates"]
Projections = Float[np.ndarray, "directions _"]
"""Coordinates along each direction, ascending."""


@dataclass(frozen=True, slots=True)
class SlicedWassersteinConfig:
    """Settings of the sampling of a picture.

    Attributes:
        directions: How many random directions.
        patch_px: The side of a patch.
        scales: How often the picture is looked at, each time at half the size before.
        samples: The most points of a picture at a scale; of more, so many are drawn.
        seed: Decides the directions and the draws, the same for all pictures.
    """

    directions: int = 128
    patch_px: int = 7
    scales: int = 3
    samples: int = 4096
    seed: int = 0

    def __post_init__(self) -> None:
        if min(self.directions, self.patch_px, self.scales, self.samples) < 1:
            raise ValueError("directions, patch_px, scales and samples are at least 1")
        require_within(SEEDS, self, "seed")


@dataclass(frozen=True, slots=True)
class PictureProjections:
    """The samples of a picture: its pixels, and its patches from the full scale down.

    `texture` are the patches, each channel of each without its mean.
    """

    colors: Projections
    patches: Sequence[Projections]
    texture: Sequence[Projections]


def sliced_wasserstein(a: Projections, b: Projections) -> float:
    """Returns the sliced Wasserstein distance of order 2 of two sets of projected points.

        SW(a, b)^2 = mean over directions of the integral over u in [0, 1] of
                     (F_a^-1(u) - F_b^-1(u))^2,

    F^-1 the quantiles (Bonneel et al. 2015, section 2.2). With as many points in both this pairs
    the sorted ones; otherwise the quantiles are taken at the middles of as many equal steps as the
    larger set has points.
    """
    steps = max(a.shape[1], b.shape[1])
    difference = _quantiles(a, steps) - _quantiles(b, steps)
    return float(np.sqrt(np.mean(np.square(difference, dtype=np.float64))))


def color_distance(a: PictureProjections, b: PictureProjections) -> float:
    """Returns the distance of the colors: 0 for equal palettes in equal proportions."""
    return sliced_wasserstein(a.colors, b.colors)


def patch_distance(a: PictureProjections, b: PictureProjections) -> float:
    """Returns the distance of the patches, the mean over the scales that both pictures have."""
    return _over_scales(a.patches, b.patches)


def texture_distance(a: PictureProjections, b: PictureProjections) -> float:
    """Returns the distance of the patches without their means, the mean over the same scales.

    0 for pictures that are even wherever a patch can be; colors that are only shifted do not count.
    """
    return _over_scales(a.texture, b.texture)


def picture_projections(image: Picture, config: SlicedWassersteinConfig) -> PictureProjections:
    """Returns the projections of a picture.

    A scale at which the picture is smaller than a patch is left out.

    Args:
        image: RGB in [0, 1]; what lies beyond is clipped.
        config: Settings of the samples.

    Raises:
        InputError: The picture itself is smaller than a patch.
    """
    if min(image.shape[:2]) < config.patch_px:
        raise InputError(
            f"picture of {image.shape[1]}x{image.shape[0]} pixels",
            f"is smaller than a patch of {config.patch_px} pixels",
            "Measure larger pictures",
        )
    colors = _sampled_patches(_lab(image), 1, config)
    patches = [
        _sampled_patches(_lab(small), config.patch_px, config) for small in _scales(image, config)
    ]
    return PictureProjections(
        projected(_flat(colors), config),
        [projected(_flat(p), config) for p in patches],
        [projected(_flat(p - p.mean(axis=(2, 3), keepdims=True)), config) for p in patches],
    )


def projected(points: Points, config: SlicedWassersteinConfig) -> Projections:
    """Returns the points' coordinates along the random directions, sorted."""
    directions = random_directions(points.shape[1], config)
    return np.asarray(np.sort(directions @ points.T, axis=1))


def random_directions(coordinates: int, config: SlicedWassersteinConfig) -> Directions:
    """Returns directions of length 1, uniform on the sphere."""
    rng = np.random.default_rng(config.seed)
    drawn = rng.standard_normal((config.directions, coordinates))
    directions = drawn / np.linalg.norm(drawn, axis=1, keepdims=True)
    return np.asarray(directions, dtype=np.float32)


def _lab(image: Picture) -> Picture:
    """Returns L* in [0, 100], a* and b*, of sRGB."""
    rgb = np.clip(image, 0, 1).astype(np.float32)
    return np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2LAB))


def _scales(image: Picture, config: SlicedWassersteinConfig) -> list[Picture]:
    found = [image]
    while len(found) < config.scales:
        height, width = (side // 2 for side in found[-1].shape[:2])
        if min(height, width) < config.patch_px:
            break
        found.append(cv2.resize(found[-1], (width, height), interpolation=cv2.INTER_AREA))
    return found


def _sampled_patches(lab: Picture, side: int, config: SlicedWassersteinConfig) -> Patches:
    windows = np.lib.stride_tricks.sliding_window_view(lab, (side, side), axis=(0, 1))
    rows, columns = windows.shape[:2]
    places = np.arange(rows * columns)
    if places.size > config.samples:
        rng = np.random.default_rng(config.seed)
        places = rng.choice(places.size, config.samples, replace=False)
    return np.asarray(windows[places // columns, places % columns])


def _flat(patches: Patches) -> Points:
    return patches.reshape(len(patches), -1)


def _over_scales(a: Sequence[Projections], b: Sequence[Projections]) -> float:
    return float(np.mean([sliced_wasserstein(x, y) for x, y in zip(a, b, strict=False)]))


def _quantiles(projections: Projections, steps: int) -> Projections:
    points = projections.shape[1]
    at = (np.arange(steps) * 2 + 1) * points // (2 * steps)
    return projections if points == steps else projections[:, at]
