"""Colors that depend on the view, fitted by values at lattice points.

    color(x, d) = sigmoid(base(x) + slope(x) . (d - mean direction))

A base for each of red, green and blue, and one slope for all three: what depends on the view is
mostly how bright a surface looks. Both are trilinear interpolations. They are fitted by weighted
least squares to pixels and samples of what cameras see: simultaneous iterative reconstruction
(Gilbert 1972) with the momentum of Nesterov (1983).
Points that no camera sees take the color of the mean direction, and no slope.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np
import torch
from jaxtyping import Float, Int16, Int64
from torch import Tensor

from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import RadianceField
from styletrf.field.weight_sharpening import sharpened
from styletrf.geometry.cameras import Camera, fitted_to
from styletrf.viewer import refit_kernels
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
        of_samples: How much samples count, pixels count for the rest of 1.
    """

    rays: int = 1_600_000
    rounds: int = 16
    prior: float = 0.02
    of_samples: float = 0.2


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
    """Samples of rays that are heavy enough to be seen.

    Attributes:
        low: The lowest of the points around each.
        rest: Where between them each is.
        weights: Of the samples.
        colors: Of the samples.
        counts: How many samples each ray has.
        directions: Of the rays, from the mean direction.
    """

    low: Int16[np.ndarray, "samples 3"]
    rest: Float[np.ndarray, "samples 3"]
    weights: Float[np.ndarray, " samples"]
    colors: Float[np.ndarray, "samples 3"]
    counts: Int64[np.ndarray, " rays"]
    directions: Float[np.ndarray, "rays 3"]


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
    base = colors_along(field, lattice, torch.from_numpy(mean))
    start = np.concatenate([base, np.zeros_like(base)], axis=1)
    fitted = _fitted(
        _joined(_seen_colors(field, views, lattice, config, mean)), start, lattice, config
    )
    return RefittedColors(fitted[:, :3], fitted[:, 3:], mean)


def _fitted(
    seen: _SeenColors,
    start: Float[np.ndarray, "points 6"],
    lattice: BrickLattice,
    config: RefitConfig,
) -> Float[np.ndarray, "points 6"]:
    """Returns the bases and slopes after all rounds."""
    starts, slots = np.append(0, np.cumsum(seen.counts)), lattice.slots
    samples = slots, seen.low, seen.rest, seen.weights
    of_samples = np.float32(config.of_samples)
    totals = refit_kernels.totals(*samples, starts, seen.directions, len(start), of_samples)
    turned = float(np.square(seen.directions).sum(axis=1).mean())
    totals += config.prior * np.array([1, turned], np.float32)
    shares = 0.5 / totals.repeat(3, axis=1)  # bases and slopes move at once
    values, ahead = start, start.copy()
    for k in range(config.rounds):
        lacking = refit_kernels.lacking(
            *samples, seen.colors, starts, seen.directions, ahead, of_samples
        )
        improved = np.add(ahead, np.multiply(lacking, shares, out=lacking), out=lacking)
        ahead = np.subtract(improved, values, out=values)
        ahead *= np.float32(k / (k + 3))
        ahead += improved
        values = improved
    return values


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


def _joined(parts: Iterator[_SeenColors]) -> _SeenColors:
    all_parts = list(parts)
    names = [each.name for each in fields(_SeenColors)]
    return _SeenColors(
        *(np.concatenate([getattr(part, name) for part in all_parts]) for name in names)
    )


def _seen_colors(
    field: RadianceField,
    views: Views,
    lattice: BrickLattice,
    config: RefitConfig,
    mean: Float[np.ndarray, " 3"],
) -> Iterator[_SeenColors]:
    """Yields the samples of each camera that are heavy enough to be seen."""
    pixels = max(64.0, config.rays / len(views.cameras))
    kernels, appearance = kernels_for(CPU), field.appearance
    for camera in views.cameras:
        share = min(2.0, (pixels / (camera.width * camera.height)) ** 0.5)
        long_side = round(share * max(camera.width, camera.height))
        heavy, directions = heavy_samples(field, views, fitted_to(camera, long_side))
        heavy = sharpened(heavy, appearance.weight_power, kernels)
        components = appearance.components(heavy.positions, kernels)
        color = appearance.decode(components, directions, heavy.ray, kernels)
        low, rest = lattice.cells(heavy.positions.numpy())
        counts = np.bincount(heavy.ray.numpy(), minlength=len(directions))
        yield _SeenColors(
            low.astype(np.int16), rest.astype(np.float32), heavy.weights.numpy(), color.numpy(),
            counts, (directions.numpy() - mean).astype(np.float32),
        )  # fmt: skip


def mean_direction(cameras: Sequence[Camera]) -> Float[np.ndarray, " 3"]:
    """Returns the mean of where cameras look, in the normalized world; short if all around."""
    mean: Float[np.ndarray, " 3"] = np.mean([camera.forward_world for camera in cameras], axis=0)
    return mean.astype(np.float32)
