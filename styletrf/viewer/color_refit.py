"""Colors that depend on the view, fitted by values at lattice points.

    color(x, d) = sigmoid(base(x) + slope(x) . t(d) + tint(d))

There is a base for each of red, green and blue, and one slope for all three: mostly the brightness
of a surface depends on the view. Both are trilinear interpolations. The tint is the same
everywhere: light and exposure change with the direction of a photograph. For the tint and t see
`styletrf.viewer.view_directions`.

Bases, slopes and tint are fitted by weighted least squares to the pixels and samples of cameras.
Bases and slopes follow simultaneous algebraic reconstruction (Andersen and Kak 1984) by subsets of
the cameras, with the momentum of Nesterov (1983) from pass to pass. The tint takes a step of Gauss
and Newton before the first pass and after each one. Points that no camera sees keep the color of
the mean direction, without a slope.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from jaxtyping import Float, Int16, Int64
from torch import Tensor

from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import RadianceField
from styletrf.field.weight_sharpening import sharpened
from styletrf.geometry.cameras import Camera
from styletrf.viewer import refit_kernels
from styletrf.viewer.lattice import BrickLattice
from styletrf.viewer.view_directions import ViewDirections, view_directions
from styletrf.viewer.visibility import CPU, Views, heavy_samples, of_pixels

_CHUNK = 1 << 17
_TINT_STEP_SIZE = np.float32(0.6)
"""The part of its step that the tint takes after a pass, because points move, too."""
_TINT_DAMPING, _LEAST_SQUARE = 1e-4, 1e-12
"""The fraction added to the diagonal of the tint's equations, and the least value there."""
_TINT_EVERY = 8
"""Every eighth ray enters these equations."""
_FEW_PIXELS = 500.0


@dataclass(frozen=True, slots=True)
class RefitConfig:
    """Settings of the fit of colors.

    Attributes:
        samples: About the most samples of the rays of all cameras together; time and memory grow
            with them.
        samples_of_point: About the most samples there for each point that is fitted: with ten,
            pictures of the demo's courtyard lose 0.04 dB against twenty, and with five 0.4 dB.
        passes: The number of passes over all rays.
        subsets: The number of subsets of the cameras, one after another in a pass.
        prior: The weight of the color of the mean direction, in units of a sample's weight.
        of_samples: The weight of samples; pixels have the rest of 1.
    """

    samples: int = 36_000_000
    samples_of_point: float = 10.0
    passes: int = 8
    subsets: int = 4
    prior: float = 0.02
    of_samples: float = 0.2


@dataclass(frozen=True, slots=True)
class RefittedColors:
    """The fitted values at a lattice's points: see above.

    Attributes:
        base: The base of red, green and blue.
        slope: The slope along the axes of `directions`.
        directions: The axes by which the views' directions are turned, with the tint.
    """

    base: Float[np.ndarray, "points 3"]
    slope: Float[np.ndarray, "points 3"]
    directions: ViewDirections


@dataclass(frozen=True, slots=True)
class _SeenColors:
    """Samples of rays that are heavy enough to be seen.

    Attributes:
        low: The lowest of the points around each.
        rest: Where between them each is.
        weights: The weights of the samples.
        colors: The colors of the samples.
        counts: The number of samples of each ray.
        turned: The directions of the rays, see `ViewDirections`.
    """

    low: Int16[np.ndarray, "samples 3"]
    rest: Float[np.ndarray, "samples 3"]
    weights: Float[np.ndarray, " samples"]
    colors: Float[np.ndarray, "samples 3"]
    counts: Int64[np.ndarray, " rays"]
    turned: Float[np.ndarray, "rays 3"]

    @property
    def starts(self) -> Int64[np.ndarray, " rays_and_one"]:
        """The first sample of each ray, and the number of all."""
        return np.append(0, np.cumsum(self.counts))


@torch.no_grad()
def refitted_colors(
    field: RadianceField, views: Views, lattice: BrickLattice, config: RefitConfig
) -> RefittedColors:
    """Returns the colors that fit those of the views best.

    Args:
        field: The field whose appearance is fitted.
        views: The views that see it.
        lattice: The lattice of the points.
        config: The settings of the fit.
    """
    directions = view_directions(views, field.step_length)
    base = colors_along(field, lattice, torch.from_numpy(directions.mean))
    start = np.concatenate([base, np.zeros_like(base)], axis=1)
    subsets = _subsets(field, views, lattice, config, directions)
    fitted, tint = _fitted(subsets, start, directions.tint, lattice, config)
    return RefittedColors(fitted[:, :3], fitted[:, 3:], replace(directions, tint=tint))


def _fitted(
    subsets: Sequence[_SeenColors],
    start: Float[np.ndarray, "points 6"],
    tint: Float[np.ndarray, "monomials 3"],
    lattice: BrickLattice,
    config: RefitConfig,
) -> tuple[Float[np.ndarray, "points 6"], Float[np.ndarray, "monomials 3"]]:
    """Returns the bases and slopes, and the tint, after all passes.

    The tint of the starting colors costs one pass more.
    """
    sums = np.empty((refit_kernels.BANDS, *start.shape), np.float32)
    values, ahead = start, start.copy()
    step_sizes = [_step_sizes(seen, len(start), lattice, config) for seen in subsets]
    of_start = [_residuals(seen, tint, ahead, lattice, config, sums)[1] for seen in subsets]
    tint = tint + _tint_step(np.sum(of_start, axis=0))
    for k in range(config.passes):
        equations = np.zeros((3, len(tint), len(tint) + 1))
        for seen, step_size in zip(subsets, step_sizes, strict=True):
            of_points, of_tint = _residuals(seen, tint, ahead, lattice, config, sums)
            of_points.reshape(-1, 2, 3)[:] *= step_size[:, :, None]
            ahead += of_points
            equations += of_tint
        tint = tint + _TINT_STEP_SIZE * _tint_step(equations)
        improved = ahead
        ahead = np.subtract(improved, values, out=values)
        ahead *= np.float32(k / (k + 3))
        ahead += improved
        values = improved
    return values, tint


def _residuals(
    seen: _SeenColors,
    tint: Float[np.ndarray, "monomials 3"],
    values: Float[np.ndarray, "points 6"],
    lattice: BrickLattice,
    config: RefitConfig,
    sums: Float[np.ndarray, "bands points 6"],
) -> tuple[Float[np.ndarray, "points 6"], Float[np.ndarray, "3 monomials monomials_and_one"]]:
    """Returns the residuals of points, in `sums`, and the tint's equations; see `refit_kernels`."""
    of_points, equations = refit_kernels.residuals(
        lattice.slots, seen.low, seen.rest, seen.weights, seen.colors, seen.starts, seen.turned,
        tint, _TINT_EVERY, values, np.float32(config.of_samples), sums,
    )  # fmt: skip
    return of_points, equations


def _step_sizes(
    seen: _SeenColors, n_points: int, lattice: BrickLattice, config: RefitConfig
) -> Float[np.ndarray, "points 2"]:
    """Returns the step sizes of bases and slopes, as fractions of their residuals."""
    samples = lattice.slots, seen.low, seen.rest, seen.weights
    of_samples = np.float32(config.of_samples)
    totals = refit_kernels.totals(*samples, seen.starts, seen.turned, n_points, of_samples)
    step_sizes: Float[np.ndarray, "points 2"] = 0.5 / (totals + np.float32(config.prior))
    return step_sizes


def _tint_step(
    equations: Float[np.ndarray, "3 monomials monomials_and_one"],
) -> Float[np.ndarray, "monomials 3"]:
    """Returns the step that solves the tint's normal equations, damped as by Marquardt (1963)."""
    upper, right = equations[..., :-1], equations[..., -1:]
    squares = upper + np.triu(upper, 1).transpose(0, 2, 1)
    one = np.eye(squares.shape[-1])
    damped = squares + (_TINT_DAMPING * squares + _LEAST_SQUARE) * one
    step: Float[np.ndarray, "monomials 3"] = np.linalg.solve(damped, right)[..., 0].T
    return step.astype(np.float32)


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


def _subsets(
    field: RadianceField,
    views: Views,
    lattice: BrickLattice,
    config: RefitConfig,
    directions: ViewDirections,
) -> list[_SeenColors]:
    """Returns the samples of each subset of the cameras, every n-th of them."""
    n_subsets = min(config.subsets, len(views.cameras))
    samples = min(config.samples, config.samples_of_point * float(lattice.needed.sum()))
    pixels = samples / len(views.cameras) / _samples_of_ray(field, views)
    found = []
    for first in range(n_subsets):
        cameras = views.cameras[first::n_subsets]
        parts = [
            _seen_colors(field, views, lattice, camera, pixels, directions) for camera in cameras
        ]
        names = [each.name for each in fields(_SeenColors)]
        found.append(
            _SeenColors(
                *(np.concatenate([getattr(part, name) for part in parts]) for name in names)
            )
        )
    return found


def _samples_of_ray(field: RadianceField, views: Views) -> float:
    """Returns how many samples a ray has that are heavy enough to be seen, at least 1."""
    few = [of_pixels(camera, _FEW_PIXELS) for camera in views.cameras]
    samples = sum(len(heavy_samples(field, views, camera)[0].weights) for camera in few)
    return max(1.0, samples / sum(camera.width * camera.height for camera in few))


def _seen_colors(
    field: RadianceField,
    views: Views,
    lattice: BrickLattice,
    camera: Camera,
    pixels: float,
    directions: ViewDirections,
) -> _SeenColors:
    """Returns the samples of a camera that are heavy enough to be seen, of about so many pixels."""
    kernels, appearance = kernels_for(CPU), field.appearance
    heavy, along = heavy_samples(field, views, of_pixels(camera, pixels))
    heavy = sharpened(heavy, appearance.weight_power, kernels)
    components = appearance.components(heavy.positions, kernels)
    color = appearance.decode(components, along, heavy.ray, kernels)
    low, rest = lattice.cells(heavy.positions.numpy())
    counts = np.bincount(heavy.ray.numpy(), minlength=len(along))
    return _SeenColors(
        low.astype(np.int16), rest.astype(np.float32), heavy.weights.numpy(), color.numpy(),
        counts, directions.turned(along.numpy()),
    )  # fmt: skip
