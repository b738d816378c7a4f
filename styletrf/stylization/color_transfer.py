"""Gives painted views the colors of the painting or of the photographs."""

from collections.abc import Sequence
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float

Image = Float[np.ndarray, "_ _ 3"]
Colors = Literal["style", "photograph", "luminance"]
ColorMap = tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, " 3"]]
"""A matrix, and the offset that is added after it."""
Opacities = Sequence[Float[np.ndarray, "_ _"]] | None
"""The opacities of views; None where all pixels count."""

MOST_GAIN = 8.0
"""The most gain of the map along any axis of color: noise must not give a gray painting hues."""

MOST_GAIN_TO_PAINTING = 1.5
"""The most gain of the map to the painting's colors, which must not paint in a network's place."""


def in_colors(
    painted: Sequence[Image],
    unstylized: Sequence[Image],
    painting: Image,
    colors: Colors,
    opacities: Opacities = None,
) -> list[Image]:
    """Returns the painted views in the wanted colors, within [0, 1].

    `style` moves all of them by the one linear map that gives them the painting's mean and
    covariance (as Zhang et al., ECCV 2022, section 4.3), as far as `MOST_GAIN_TO_PAINTING` allows;
    `photograph` likewise gives them the unstylized views'; `luminance` keeps of the painting the
    lightness alone (CIE L*a*b*). A map of colors is the same in every view, so consistency stays.

    Args:
        painted: RGB in [0, 1].
        unstylized: The same views before.
        painting: The style image.
        colors: The source of the colors.
        opacities: Those of the views, if they show an object on a ground that is not counted.
    """
    if colors == "luminance":
        return [_with_lightness_of(p, q) for p, q in zip(unstylized, painted, strict=True)]
    if colors == "style":
        found = map_to_painting(painted, painting, opacities)
    else:
        weights = _weights(opacities)
        found = color_map(
            _colors(painted), _colors(unstylized), source_weights=weights, target_weights=weights
        )
    return [recolored(image, found) for image in painted]


def map_to_painting(
    painted: Sequence[Image], painting: Image, opacities: Opacities = None
) -> ColorMap:
    """Returns the map of `in_colors` that gives these views the colors `style`."""
    source, target = _colors(painted), painting.reshape(-1, 3)
    return color_map(source, target, MOST_GAIN_TO_PAINTING, _weights(opacities))


def recolored(image: Image, found: ColorMap) -> Image:
    """Returns the image under a map of colors, within [0, 1]."""
    matrix, offset = found
    shown: Image = np.clip(image @ matrix.T + offset, 0, 1).astype(np.float32)
    return shown


def color_map(
    source: Float[np.ndarray, "source 3"],
    target: Float[np.ndarray, "target 3"],
    most_gain: float = MOST_GAIN,
    source_weights: Float[np.ndarray, " source"] | None = None,
    target_weights: Float[np.ndarray, " target"] | None = None,
) -> ColorMap:
    """Returns matrix and offset that give colors the mean and the covariance of others.

    The symmetric map T = S^-1/2 (S^1/2 R S^1/2)^1/2 S^-1/2 of covariances S to R, which moves the
    colors least (Monge's, Pitie and Kokaram 2007, eq. 6). Along axes on which the source hardly
    varies the gain is at most `MOST_GAIN`, and along any axis at most `most_gain`. Colors count by
    their weights, where given.
    """
    moments = _moments(source, source_weights), _moments(target, target_weights)
    means, covariances = zip(*moments, strict=True)
    least = np.trace(covariances[1]) / MOST_GAIN**2 + np.finfo(np.float64).tiny
    root, inverse = _roots(covariances[0], least)
    middle, _ = _roots(root @ covariances[1] @ root, 0.0)
    gains, axes = np.linalg.eigh(inverse @ middle @ inverse)
    matrix = (axes * np.minimum(gains, most_gain)) @ axes.T
    return matrix, means[1] - matrix @ means[0]


def _colors(images: Sequence[Image]) -> Float[np.ndarray, "colors 3"]:
    return np.concatenate([image.reshape(-1, 3) for image in images])


def _weights(opacities: Opacities) -> Float[np.ndarray, " colors"] | None:
    """Returns the weights of colors by their opacities; equal ones where nothing is opaque."""
    if opacities is None:
        return None
    weights = np.concatenate([part.ravel() for part in opacities]).astype(np.float64)
    return np.maximum(weights, np.finfo(np.float32).tiny)


def _moments(
    colors: Float[np.ndarray, "colors 3"], weights: Float[np.ndarray, " colors"] | None
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, "3 3"]]:
    """Returns mean and covariance, in float64: sums of millions in float32 are off by levels."""
    wide = colors.astype(np.float64)
    covariance = np.cov(wide, rowvar=False, aweights=weights, bias=weights is not None)
    return np.average(wide, axis=0, weights=weights), covariance


def _roots(covariance: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns the square root, eigenvalues at least `least`, and its inverse."""
    values, vectors = np.linalg.eigh(covariance)
    roots = np.sqrt(np.maximum(values, least))
    with np.errstate(divide="ignore"):
        inverse = np.where(roots > 0, 1 / roots, 0)
    return (vectors * roots) @ vectors.T, (vectors * inverse) @ vectors.T


def _with_lightness_of(hues: Image, light: Image) -> Image:
    lab, other = (cv2.cvtColor(i.astype(np.float32), cv2.COLOR_RGB2LAB) for i in (hues, light))
    lab[..., 0] = other[..., 0]
    return np.clip(cv2.cvtColor(lab, cv2.COLOR_LAB2RGB), 0, 1)
