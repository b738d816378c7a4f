"""Colors that depend on the view, fitted by values at lattice points.

    color(x, d) = sigmoid(base(x) + slope(x) . (d - mean direction))

A base for each of red, green and blue, and one slope for all three: what depends on the view is
mostly how bright a surface looks. Both are trilinear interpolations, fitted by weighted least
squares to what cameras see (simultaneous iterative reconstruction, Gilbert 1972).
Points that no camera sees take the color of the mean direction, and no slope.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import RadianceField
from styletrf.field.weight_sharpening import sharpened
from styletrf.geometry.cameras import Camera, fitted_to
from styletrf.viewer.lattice import BrickLattice
from styletrf.viewer.visibility import CPU, Views, heavy_samples

_CHUNK = 1 << 17


@dataclass(frozen=True, slots=True)
class RefitConfig:
    """How colors are fitted.

    Attributes:
        rays: Of all cameras together, at most about.
        rounds: Of the iteration.
        prior: How much the color of the mean direction counts, in units of a sample's weight.
    """

    rays: int = 400_000
    rounds: int = 8
    prior: float = 0.02


@dataclass(frozen=True, slots=True)
class RefittedColors:
    """Values at a lattice's points: see above.

    Attributes:
        base: Red, green and blue.
        slope: Along the axes of the normalized world.
        mean_direction: From which directions are counted.
    """

    base: Float[np.ndarray, "points 3"]
    slope: Float[np.ndarray, "points 3"]
    mean_direction: Float[np.ndarray, " 3"]


@dataclass(frozen=True, slots=True)
class _SeenColors:
    """Samples: the stored points around them, the weights of these, colors, and whence seen."""

    addresses: Int64[np.ndarray, "samples 8"]
    weights: Float[np.ndarray, "samples 8"]
    colors: Float[np.ndarray, "samples 3"]
    directions: Float[np.ndarray, "samples 3"]


@torch.no_grad()
def refitted_colors(
    field: RadianceField, views: Views, lattice: BrickLattice, config: RefitConfig
) -> RefittedColors:
    """Returns what fits the colors that the views see.

    Args:
        field: Whose appearance is fitted.
        views: That see it.
        lattice: Of the points.
        config: How.
    """
    mean = mean_direction(views.cameras)
    seen = _joined(_seen_colors(field, views, lattice, config, mean))
    base = colors_along(field, lattice, torch.from_numpy(mean))
    slope = np.zeros_like(base)
    total = config.prior + _sums(seen, seen.weights, len(base))
    turned = np.square(seen.directions).sum(axis=1, keepdims=True)
    turned_total = config.prior * float(turned.mean()) + _sums(
        seen, seen.weights * turned, len(base)
    )
    for _ in range(config.rounds):
        lacking = _lacking(seen, base, slope)
        base += _spread(seen, lacking, len(base)) / total[:, None]
        brightness = _lacking(seen, base, slope).mean(axis=1, keepdims=True)
        slope += _spread(seen, brightness * seen.directions, len(base)) / turned_total[:, None]
    return RefittedColors(base, slope, mean)


def colors_along(
    field: RadianceField,
    lattice: BrickLattice,
    direction: Float[Tensor, " 3"],
) -> Float[np.ndarray, "points 3"]:
    """Returns the colors before their sigmoid at the lattice's points, seen along a direction."""
    kernels = kernels_for(CPU)
    positions = 2 * lattice.points() / (np.array(lattice.resolution) - 1) - 1
    parts = []
    for chunk in torch.from_numpy(positions.astype(np.float32)).split(_CHUNK):
        components = field.appearance.components(chunk, kernels)
        ray = torch.zeros(len(chunk), dtype=torch.int64)
        color = field.appearance.decode(components, direction[None], ray, kernels)
        parts.append(torch.logit(color, eps=1e-3).numpy())
    return np.concatenate(parts)


def _lacking(
    seen: _SeenColors, base: Float[np.ndarray, "points 3"], slope: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, "samples 3"]:
    """Returns what samples lack before the sigmoid, to first order."""
    turned = (_at_samples(seen, slope) * seen.directions).sum(axis=1, keepdims=True)
    shown = 1 / (1 + np.exp(-_at_samples(seen, base) - turned))
    steepness = np.maximum(shown * (1 - shown), 0.05)
    lacking: Float[np.ndarray, "samples 3"] = (seen.colors - shown) / steepness
    return lacking


def _at_samples(
    seen: _SeenColors, values: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, "samples 3"]:
    """Returns the interpolated values."""
    shares = seen.weights / np.maximum(seen.weights.sum(axis=1, keepdims=True), 1e-9)
    columns = [(shares * values[seen.addresses, k]).sum(axis=1) for k in range(values.shape[1])]
    return np.stack(columns, axis=1)


def _spread(
    seen: _SeenColors, amounts: Float[np.ndarray, "samples 3"], n_points: int
) -> Float[np.ndarray, "points 3"]:
    """Returns the amounts summed over the samples around each point, by their weights."""
    columns = [_sums(seen, seen.weights * amounts[:, k, None], n_points) for k in range(3)]
    return np.stack(columns, axis=1)


def _sums(
    seen: _SeenColors, amounts: Float[np.ndarray, "samples 8"], n_points: int
) -> Float[np.ndarray, " points"]:
    """Returns the sum of the amounts that go to each point."""
    sums = np.bincount(seen.addresses.ravel(), amounts.ravel(), minlength=n_points)
    return sums.astype(np.float32)


def _joined(parts: Iterable[_SeenColors]) -> _SeenColors:
    fields = zip(*((p.addresses, p.weights, p.colors, p.directions) for p in parts), strict=True)
    return _SeenColors(*map(np.concatenate, fields))


def _seen_colors(
    field: RadianceField,
    views: Views,
    lattice: BrickLattice,
    config: RefitConfig,
    mean: Float[np.ndarray, " 3"],
) -> Iterator[_SeenColors]:
    """Yields the samples of each camera that are heavy enough to be seen."""
    side = max(8, round((config.rays / len(views.cameras)) ** 0.5))
    kernels, appearance = kernels_for(CPU), field.appearance
    for camera in views.cameras:
        heavy, directions = heavy_samples(field, views, fitted_to(camera, side))
        heavy = sharpened(heavy, appearance.weight_power, kernels)
        components = appearance.components(heavy.positions, kernels)
        color = appearance.decode(components, directions, heavy.ray, kernels)
        address, share = lattice.corners(heavy.positions.numpy())
        weights = np.where(address < 0, 0, share * heavy.weights.numpy()[:, None])
        turned = directions[heavy.ray].numpy() - mean
        yield _SeenColors(np.maximum(address, 0), weights, color.numpy(), turned)


def mean_direction(cameras: Sequence[Camera]) -> Float[np.ndarray, " 3"]:
    """Returns the mean of where cameras look, in the normalized world; short if all around."""
    mean: Float[np.ndarray, " 3"] = np.mean([camera.forward_world for camera in cameras], axis=0)
    return mean.astype(np.float32)
