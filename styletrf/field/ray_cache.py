"""Rays marched once: with the density frozen their samples and weights never change."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.capture.view_images import ViewImages
from styletrf.field.appearance import ColorModel
from styletrf.field.kernels import Kernels, Samples
from styletrf.field.pixel_rays import pixel_rays
from styletrf.field.radiance_field import RadianceField
from styletrf.field.view_rays import ViewRays
from styletrf.field.weight_sharpening import sharpened

_MARCHED_AT_ONCE = 1 << 15


@dataclass(frozen=True, slots=True)
class RayBatch:
    """Rays with the samples that carry their weight, and the colors they should have."""

    samples: Samples
    view_directions: Float[Tensor, "rays 3"]
    opacity: Float[Tensor, " rays"]
    target: Float[Tensor, "rays 3"]

    def color(self, appearance: ColorModel, kernels: Kernels) -> Float[Tensor, "rays 3"]:
        """Returns the colors of the rays, differentiable in the appearance."""
        return self._composed(self._colors(appearance, kernels), appearance, kernels)

    def color_and_variance(
        self, appearance: ColorModel, kernels: Kernels
    ) -> tuple[Float[Tensor, "rays 3"], Float[Tensor, " rays"]]:
        """Returns the colors of the rays, and the variance of the color along each ray.

        The variance is sum_s w_s |c_s - m|^2 with m = sum_s w_s c_s / opacity, the mean color of
        the samples; the background has no part in it. Differentiable in the samples' colors.
        """
        colors = self._colors(appearance, kernels)
        with torch.no_grad():  # at the mean the variance is stationary: its gradient is whole
            total = kernels.composite(self.samples, colors)
            mean = total / self.opacity.clamp(min=torch.finfo(total.dtype).tiny)[:, None]
        apart = (colors - mean[self.samples.ray]).square().sum(dim=1, keepdim=True)
        seen = self._composed(colors, appearance, kernels)
        return seen, kernels.composite(self.samples, apart)[:, 0]

    def _colors(self, appearance: ColorModel, kernels: Kernels) -> Float[Tensor, "samples 3"]:
        components = appearance.components(self.samples.positions, kernels)
        return appearance.decode(components, self.view_directions, self.samples.ray, kernels)

    def _composed(
        self, colors: Float[Tensor, "samples 3"], appearance: ColorModel, kernels: Kernels
    ) -> Float[Tensor, "rays 3"]:
        behind = (1 - self.opacity)[:, None] * appearance.background_color()
        return kernels.composite(self.samples, colors) + behind

    def error(self, appearance: ColorModel, kernels: Kernels) -> Float[Tensor, ""]:
        """Returns the mean squared error of the colors, differentiable in the appearance."""
        return (self.color(appearance, kernels) - self.target).square().mean()

    def one_sample_per_ray(self, generator: torch.Generator) -> "RayBatch":
        """Returns the rays with one sample each, drawn by the weights, that has the ray's opacity.

        The expected error of an opaque ray is then the mean error of its samples, by their weights.
        Rays without samples stay without any.

        Args:
            generator: On the CPU.
        """
        counts, end = self.samples.offsets.diff(), self.samples.offsets[1:]
        fraction = 1 - torch.rand(len(counts), generator=generator).to(self.opacity)  # above 0
        drawn = torch.minimum(self.samples.reached(fraction * self.opacity), end - 1)
        ray = counts.nonzero()[:, 0]
        offsets = torch.cat([counts.new_zeros(1), (counts > 0).cumsum(0)])
        one = self.samples.chosen(offsets, drawn[ray])
        return replace(self, samples=replace(one, weights=self.opacity[ray]))


@dataclass(frozen=True, slots=True)
class RayCache:
    """Rays with their samples' positions and weights, and the colors they should have.

    The kept weights of a ray are scaled up to its opacity (0 where none were kept); `dropped` is
    the mean mass that was left out before.
    """

    offsets: Int64[Tensor, " rays_and_one"]
    positions: Float[Tensor, "samples 3"]
    weights: Float[Tensor, " samples"]
    view_directions: Float[Tensor, "rays 3"]
    opacity: Float[Tensor, " rays"]
    target: Float[Tensor, "rays 3"]
    dropped: float

    @property
    def nbytes(self) -> int:
        """The bytes of memory that the cache takes."""
        tensors = (self.offsets, self.positions, self.weights, self.view_directions)
        return sum(tensor.nbytes for tensor in (*tensors, self.opacity, self.target))

    def batch(self, k: int, size: int) -> RayBatch:
        """Returns the k-th batch, starting over where the rays end.

        The rays are divided evenly into as few batches of at most `size` as hold all.
        """
        total = len(self.opacity)
        count = max(1, -(-total // size))
        first, last = (total * (k % count + end) // count for end in (0, 1))
        return self._rays(first, last)

    def tiles(self, size: int) -> Iterator[RayBatch]:
        """Yields all rays in order, `size` at a time."""
        for first in range(0, len(self.opacity), size):
            yield self._rays(first, min(first + size, len(self.opacity)))

    def _rays(self, first: int, last: int) -> RayBatch:
        offsets = self.offsets[first : last + 1] - self.offsets[first]
        span = slice(int(self.offsets[first]), int(self.offsets[last]))
        ray = torch.repeat_interleave(offsets.diff())
        weights = self.weights[span]
        not_kept = torch.full_like(weights, torch.nan)  # where samples lie along their rays
        return RayBatch(
            Samples(offsets, ray, not_kept, self.positions[span], weights),
            self.view_directions[first:last],
            self.opacity[first:last],
            self.target[first:last],
        )


@torch.no_grad()
def march_once(
    field: RadianceField,
    rays: ViewRays,
    images: ViewImages,
    draws: Int64[Tensor, " rays"],
    kernels: Kernels,
    *,
    min_weight: float,
    termination: float,
    cache_bytes: int,
    generator: torch.Generator | None = None,
) -> RayCache:
    """Returns the cache of the rays through pixels, until it is full.

    Args:
        field: The field whose density is marched through.
        rays: The rays through the pixels of the images.
        images: The images whose colors the rays should have.
        draws: The pixels by their numbers.
        kernels: The backend to compute with.
        min_weight: Samples lighter than this are not kept.
        termination: See `RenderConfig`.
        cache_bytes: The size after which no further rays are marched.
        generator: Jitters the samples within their steps; without it they lie in the middle.
    """
    march = field.density.march(termination)
    parts: list[tuple[Tensor, ...]] = []
    for draw in draws.to(images.device).split(_MARCHED_AT_ONCE):
        segments, target = pixel_rays(rays, images, draw)
        jitter = torch.full((len(segments),), 0.5)
        if generator is not None:
            jitter = torch.rand(len(segments), generator=generator)
        samples = kernels.trace(field.density.factors, segments, jitter.to(images.device), march)
        kept, opacity, dropped = _kept(samples, min_weight, field.appearance.weight_power, kernels)
        parts.append(
            (
                kept.offsets.diff(), kept.positions, kept.weights, segments.view_directions,
                opacity, target, dropped,
            )
        )  # fmt: skip
        if sum(part.nbytes for ray_part in parts for part in ray_part) > cache_bytes:
            break
    counts, positions, weights, directions, opacity, target, dropped = (
        torch.cat(column) for column in zip(*parts, strict=True)
    )
    offsets = torch.cat([counts.new_zeros(1), counts.cumsum(0)])
    return RayCache(offsets, positions, weights, directions, opacity, target, float(dropped.mean()))


def _kept(
    samples: Samples, min_weight: float, power: float, kernels: Kernels
) -> tuple[Samples, Float[Tensor, " rays"], Float[Tensor, " rays"]]:
    """Returns the kept samples, the opacity their weights are scaled up to, and the mass left out.

    The opacity is 0 of a ray that keeps no sample.
    """
    kept = sharpened(kernels.prune(samples, min_weight), power, kernels)
    opacity, kept_mass = kernels.opacity(samples), kernels.opacity(kept)
    covered = torch.where(kept_mass == 0, 0, opacity)  # one that is NaN is kept and seen
    weights = kept.weights * (covered / kept_mass.clamp(min=1e-6))[kept.ray]
    return replace(kept, weights=weights), covered, opacity - kept_mass
