"""Opacities and colors of splats that lie where they lie, by least squares.

With the geometry fixed a picture's weights are computed once. Its colors are linear in those of the
splats; conjugate gradients solve for them. A small change of opacities is linear, too: steps of
simultaneous iterative reconstruction (Gilbert 1972) take turns with the colors.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from styletrf.exports.splat_compositing import opacity_slopes, to_pixels, to_splats, weights_of
from styletrf.exports.splat_footprints import Footprints

Picture = Float[np.ndarray, "pixels 3"]
Colors = Float[np.ndarray, "splats 3"]
Opacities = Float[np.ndarray, " splats"]


@dataclass(frozen=True, slots=True)
class FitConfig:
    """How opacities and colors are solved for.

    Attributes:
        opacity: All splats' before the first step.
        rounds: Of opacity steps, each followed by colors.
        opacity_steps: Of a round.
        color_steps: Of the conjugate gradients.
        prior: How much a splat's mean color counts, in units of a pixel's squared weight.
    """

    opacity: float = 0.9
    rounds: int = 4
    opacity_steps: int = 3
    color_steps: int = 8
    prior: float = 0.05


@dataclass(frozen=True, slots=True)
class SeenSplats:
    """Splats as some cameras see them.

    Attributes:
        views: The footprints in each picture.
        n_splats: How many there are.
        background: The color behind everything.
    """

    views: Sequence[Footprints]
    n_splats: int
    background: Float[np.ndarray, " 3"]


def shown(
    view: Footprints,
    opacities: Opacities,
    colors: Colors,
    background: Float[np.ndarray, " 3"],
) -> Picture:
    """Returns the picture of one view."""
    weights, left = weights_of(view.n_pixels, view.pixel, view.splat, view.share, opacities)
    picture: Picture = left[:, None] * background.astype(np.float32)
    to_pixels(view.pixel, view.splat, weights, colors, picture)
    return picture


def fitted_opacities(seen: SeenSplats, pictures: Sequence[Picture], config: FitConfig) -> Opacities:
    """Returns the opacities, in [0.02, 0.99], with which splats come closest to pictures.

    Args:
        seen: The splats.
        pictures: What each view should show.
        config: How.
    """
    opacities = np.full(seen.n_splats, config.opacity, np.float32)
    for _ in range(config.rounds):
        colors = fitted_colors(seen, pictures, opacities, config)
        for _ in range(config.opacity_steps):
            opacities = _opacity_step(seen, pictures, opacities, colors)
    return opacities


def fitted_colors(
    seen: SeenSplats, pictures: Sequence[Picture], opacities: Opacities, config: FitConfig
) -> Colors:
    """Returns the colors, in [0, 1], with which splats come closest to pictures.

    Least squares with a weak pull to each splat's mean color, solved by conjugate gradients with
    the diagonal as preconditioner.
    """
    weights, lefts = zip(
        *(weights_of(v.n_pixels, v.pixel, v.splat, v.share, opacities) for v in seen.views),
        strict=True,
    )
    background = seen.background.astype(np.float32)
    targets = [
        (picture - left[:, None] * background).astype(np.float32)
        for picture, left in zip(pictures, lefts, strict=True)
    ]
    colors, diagonal = _mean_colors(seen, pictures, weights)
    inverse = 1 / (diagonal + config.prior)
    lacking = _projected_back(seen, weights, [
        target - _projected(view, each, colors)
        for view, each, target in zip(seen.views, weights, targets, strict=True)
    ])  # fmt: skip
    step = inverse * lacking
    norm = (lacking * step).sum(axis=0)
    for _ in range(config.color_steps):
        pushed = config.prior * step + _projected_back(
            seen, weights,
            [_projected(v, w, step) for v, w in zip(seen.views, weights, strict=True)],
        )  # fmt: skip
        length = norm / np.maximum((step * pushed).sum(axis=0), 1e-12)
        colors = colors + length * step
        lacking = lacking - length * pushed
        ahead = inverse * lacking
        before, norm = norm, (lacking * ahead).sum(axis=0)
        step = ahead + norm / np.maximum(before, 1e-12) * step
    within: Colors = np.clip(colors, 0, 1).astype(np.float32)
    return within


def _projected(view: Footprints, weights: np.ndarray, values: Colors) -> Picture:
    picture = np.zeros((view.n_pixels, 3), np.float32)
    to_pixels(view.pixel, view.splat, weights, values.astype(np.float32), picture)
    return picture


def _projected_back(
    seen: SeenSplats, weights: Sequence[np.ndarray], pictures: Sequence[Picture]
) -> Colors:
    sums = np.zeros((seen.n_splats, 3), np.float32)
    for view, each, picture in zip(seen.views, weights, pictures, strict=True):
        to_splats(view.pixel, view.splat, each, picture, sums)
    return sums


def _mean_colors(
    seen: SeenSplats, pictures: Sequence[Picture], weights: Sequence[np.ndarray]
) -> tuple[Colors, Float[np.ndarray, "splats 1"]]:
    """Returns the colors of the pixels of each splat by squared weights, and the sums of these."""
    sums = np.zeros((seen.n_splats, 4), np.float32)
    for view, each, picture in zip(seen.views, weights, pictures, strict=True):
        with_one = np.concatenate([picture, np.ones_like(picture[:, :1])], axis=1)
        to_splats(view.pixel, view.splat, each * each, with_one.astype(np.float32), sums)
    total = sums[:, 3:]
    return sums[:, :3] / np.maximum(total, 1e-9), total


def _opacity_step(
    seen: SeenSplats, pictures: Sequence[Picture], opacities: Opacities, colors: Colors
) -> Opacities:
    lift, total = (np.zeros(seen.n_splats, np.float32) for _ in range(2))
    for view, picture in zip(seen.views, pictures, strict=True):
        now = shown(view, opacities, colors, seen.background)
        lacking = (picture - now).astype(np.float32)
        row = np.zeros_like(now)
        opacity_slopes(
            view.pixel, view.splat, view.share, opacities, colors, now, lacking, lift, total, row
        )
    moved: Opacities = np.clip(opacities + lift / (total + 1e-3), 0.02, 0.99).astype(np.float32)
    return moved
