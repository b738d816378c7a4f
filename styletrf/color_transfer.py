"""Painted views in the photographs' colours: their mean and covariance, or their very hues."""

from collections.abc import Sequence
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float

Image = Float[np.ndarray, "_ _ 3"]
Colors = Literal["style", "photograph", "luminance"]

_MOST_STRETCH = 1.5

MOST_GAIN = 8.0
"""Of the map along any axis of colour: a painting in greys cannot be given hues by noise."""


LEAST_CONTRAST = 0.95
"""Aimed at for painted views: a share of the plain views' or the painting's, whichever has less."""


def in_colors(
    painted: Sequence[Image], plain: Sequence[Image], painting: Image, colors: Colors
) -> list[Image]:
    """Returns the painted views in the wanted colours, within [0, 1].

    `style` leaves them, but for a contrast that a network has not reached: all views are then
    stretched alike about their mean, see `LEAST_CONTRAST`; `photograph` moves all of them by the
    one linear map that gives them the plain views' mean and covariance; `luminance` keeps of the
    painting the lightness alone (CIE L*a*b*). What a map of colours alone does is the same in
    every view, so consistency stays.

    Args:
        painted: RGB in [0, 1].
        plain: The same views before.
        painting: The style image.
        colors: Whose.
    """
    if colors == "luminance":
        return [_with_lightness_of(p, q) for p, q in zip(plain, painted, strict=True)]
    if colors == "style":
        return _stretched(painted, LEAST_CONTRAST * min(_contrast(plain), _contrast([painting])))
    source, target = (np.concatenate([i.reshape(-1, 3) for i in s]) for s in (painted, plain))
    matrix, offset = color_map(source, target)
    return [np.clip(i @ matrix.T + offset, 0, 1).astype(np.float32) for i in painted]


def _contrast(views: Sequence[Image]) -> float:
    """Returns the deviation of colours from the mean colour of their view."""
    return float(np.sqrt(np.mean([i.var(axis=(0, 1)).mean() for i in views])))


def _stretched(views: Sequence[Image], least: float) -> list[Image]:
    present = _contrast(views)
    gain = float(np.clip(least / max(present, 1e-6), 1, _MOST_STRETCH))
    middle = np.mean([i.mean(axis=(0, 1)) for i in views], axis=0)
    return [np.clip(middle + gain * (i - middle), 0, 1).astype(np.float32) for i in views]


def color_map(
    source: Float[np.ndarray, "source 3"], target: Float[np.ndarray, "target 3"]
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, " 3"]]:
    """Returns matrix and offset that give colours the mean and the covariance of others.

    The symmetric map T = S^-1/2 (S^1/2 R S^1/2)^1/2 S^-1/2 of covariances S to R, which moves the
    colours least (Monge's, Pitie and Kokaram 2007, eq. 6). Along axes on which the source hardly
    varies the gain is at most `MOST_GAIN`.
    """
    covariances = [np.cov(c.astype(np.float64), rowvar=False) for c in (source, target)]
    least = np.trace(covariances[1]) / MOST_GAIN**2 + np.finfo(np.float64).tiny
    root, inverse = _roots(covariances[0], least)
    middle, _ = _roots(root @ covariances[1] @ root, 0.0)
    matrix = inverse @ middle @ inverse
    return matrix, target.mean(axis=0) - matrix @ source.mean(axis=0)


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
