"""Renders color, opacity and depth of rays through a field (volume rendering, Max 1995).

color = sum_i w_i c_i + (1 - sum_i w_i) background,   opacity = sum_i w_i

An appearance may require sharper weights in the color than those:
`styletrf.field.weight_sharpening`.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.configuration import require_at_least, require_within
from styletrf.field.appearance import ColorModel
from styletrf.field.kernels import Kernels, RaySegments, Samples, Sparsification, sparsify_gradient
from styletrf.field.radiance_field import RadianceField
from styletrf.field.view_rays import ViewRays
from styletrf.field.weight_sharpening import sharpened
from styletrf.geometry.cameras import Camera, pixel_centers

LEAST_OPACITY = 1e-3  # of a ray that hits something
_TILES_ON_GPU = 8  # at once: a GPU computes one tile in less time than it takes to launch


@dataclass(frozen=True, slots=True)
class RenderConfig:
    """Settings that trade the time of rendering for accuracy: see `docs/knobs.md`.

    A ray ends at transmittance `termination`; samples lighter than `min_weight` get no color;
    rays are rendered `tile` at a time, eight times as many on a GPU. `deferred` runs the color
    network once a ray, on the mean features of its samples, instead of once a sample.
    """

    termination: float = 3e-3
    min_weight: float = 5e-3
    tile: int = 16384
    deferred: bool = False

    def __post_init__(self) -> None:
        require_at_least(1, self, "tile")
        require_within("[0, 1)", self, "termination")
        require_within("[0, 1]", self, "min_weight")


@dataclass(frozen=True, slots=True)
class Rendering:
    """Color and opacity in [0, 1] and the depth Z of rays.

    The depth is that of the mean position along the ray's grid segment, its clear part counted at
    the far end, unless the ray was ended there for being opaque; in NDC that averages disparity, so
    a little fog before something far does not spoil it. The segment ends at the bounds of the
    field: those of a finished one end with its matter, and so faint pixels are no farther than it.
    Where nothing is hit (an opacity below 1e-3) it is infinite. The median depth is where the
    transmittance falls to one half, infinite where it never does: it lies on one of two surfaces
    that share a pixel, where the mean lies between them. The surface depth is the median depth, and
    the depth where less than half of the light is lost.
    """

    color: Float[Tensor, "*rays 3"]
    opacity: Float[Tensor, "*rays"]
    depth: Float[Tensor, "*rays"]
    median_depth: Float[Tensor, "*rays"]

    @property
    def surface_depth(self) -> Float[Tensor, "*rays"]:
        """The depth Z of the surface that a pixel shows; infinite where a ray hits none."""
        return torch.where(torch.isfinite(self.median_depth), self.median_depth, self.depth)


def render_color(
    appearance: ColorModel,
    kernels: Kernels,
    segments: RaySegments,
    samples: Samples,
    min_weight: float,
    *,
    deferred: bool = False,
    sparsification: Sparsification | None = None,
) -> Float[Tensor, "rays 3"]:
    """Returns the color of rays, differentiable in the appearance and the samples' weights.

    Samples below `min_weight` are left out and their mass given to the ray's others in proportion,
    or to the background where there are none: leaving them out darkens nothing. For `deferred` see
    `RenderConfig`; without it the color is the mean of the samples' colors. `sparsification` is
    that of the gradient of these.
    """
    opacity = kernels.opacity(samples)[:, None]
    pruned = kernels.prune(samples, min_weight)
    pruned = sharpened(pruned, appearance.weight_powers(pruned.positions), kernels)
    values = appearance.components(pruned.positions, kernels)
    directions = segments.view_directions
    if not deferred:
        values = appearance.decode(values, directions, pruned.ray, kernels)
    values = sparsify_gradient(values, sparsification)
    sums = kernels.composite(pruned, torch.cat([values, torch.ones_like(values[:, :1])], dim=1))
    kept = sums[:, -1:]
    color = sums[:, :-1] / kept.clamp(min=1e-6)
    if deferred:
        color = appearance.decode(
            color, directions, torch.arange(len(color)).to(pruned.ray), kernels
        )
    covered = torch.where(kept > 0, opacity, 0)
    return covered * color + (1 - covered) * appearance.background_color()


@torch.no_grad()
def render_rays(
    field: RadianceField, kernels: Kernels, segments: RaySegments, config: RenderConfig,
    appearance: ColorModel | None = None,
) -> Rendering:  # fmt: skip
    """Returns the rendering of rays, without gradient; samples lie in the middle of their steps.

    With an `appearance` in place of the field's own.
    """
    jitter = torch.full_like(segments.lengths, 0.5)
    march = field.density.march(config.termination)
    samples = kernels.trace(field.density.factors, segments, jitter, march)
    color = render_color(
        field.appearance if appearance is None else appearance,
        kernels, segments, samples, config.min_weight, deferred=config.deferred,
    )  # fmt: skip
    sums = kernels.composite(samples, torch.stack([torch.ones_like(samples.s), samples.s], dim=1))
    opacity = sums[:, 0].clamp(max=1)
    left = torch.where(1 - opacity <= config.termination, 0, 1 - opacity)
    mean_s = ((sums[:, 1] + left) / (opacity + left).clamp(min=LEAST_OPACITY)).clamp(0, 1)
    rays = torch.arange(len(segments), device=mean_s.device)
    depth = torch.where(opacity < LEAST_OPACITY, torch.inf, segments.depth_along(rays, mean_s))
    return Rendering(color.clamp(0, 1), opacity, depth, median_depth(segments, samples))


def median_depth(segments: RaySegments, samples: Samples) -> Float[Tensor, " rays"]:
    """Returns the depth Z at which each ray's transmittance falls to one half; infinite if never.

    The density is constant within a step: between T before it and T' behind it the transmittance
    falls exponentially, to 1/2 at the fraction log(1 / 2T) / log(T' / T) of the step.
    """
    median = samples.reached(torch.full_like(segments.lengths, 0.5))
    ray = (median < samples.offsets[1:]).nonzero()[:, 0]
    depth = torch.full_like(segments.lengths, torch.inf)
    depth[ray] = segments.depth_along(ray, _where_half(segments, samples, ray, median[ray]))
    return depth


def _where_half(
    segments: RaySegments, samples: Samples, ray: Int64[Tensor, " rays"], at: Int64[Tensor, " rays"]
) -> Float[Tensor, " rays"]:
    """Returns the s at which the transmittance of rays is one half, in the steps of samples `at`.

    Samples lie in the middle of their steps.
    """
    before = 1 - samples.sums_before(samples.weights, at)
    behind = (before - samples.weights[at]).clamp(min=0)
    fraction = torch.log(0.5 / before) / torch.log(behind / before)
    fraction = torch.nan_to_num(fraction, nan=0.5).clamp(0, 1)  # of a sum that rounding has moved
    s = samples.s[at] + (fraction - 0.5) / segments.n_steps[ray]
    return s.clamp(0, 1).to(samples.s.dtype)


@torch.no_grad()
def render_view(
    field: RadianceField, kernels: Kernels, rays: ViewRays, view: int, camera: Camera,
    config: RenderConfig, appearance: ColorModel | None = None,
) -> Rendering:  # fmt: skip
    """Returns the image of one of the cameras `rays` was made for, in tiles of bounded memory.

    With an `appearance` in place of the field's own.
    """
    device = field.appearance.background.device
    pixels = torch.as_tensor(pixel_centers(camera.width, camera.height), device=device)
    parts = []
    n_rays = config.tile * (_TILES_ON_GPU if device.type == "cuda" else 1)
    for tile in pixels.split(n_rays):
        parts.append(render_rays(field, kernels, rays.segments(view, tile), config, appearance))
    shape = (camera.height, camera.width)
    return Rendering(
        torch.cat([part.color for part in parts]).reshape(*shape, 3),
        torch.cat([part.opacity for part in parts]).reshape(shape),
        torch.cat([part.depth for part in parts]).reshape(shape),
        torch.cat([part.median_depth for part in parts]).reshape(shape),
    )
