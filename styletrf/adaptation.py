"""Adapting a field's appearance to stylised views, its density frozen (StyleTRF section 4.3).

With the density frozen the samples and weights of a ray never change, so a ray is marched once and
only the samples that carry its weight are kept; an iteration then costs an appearance look-up and
the colour network.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64, UInt8
from torch import Tensor

from styletrf.cameras import Camera
from styletrf.errors import NotFiniteError
from styletrf.field import Appearance, RadianceField
from styletrf.kernels import Kernels, Samples
from styletrf.pixel_rays import pixel_rays
from styletrf.progress import Progress, silent
from styletrf.space import Space, ViewRays


@dataclass(frozen=True, slots=True)
class AdaptationConfig:
    """How the appearance is adapted."""

    iterations: int = 1000
    batch: int = 4096  # rays an iteration
    factor_rate: float = 0.05
    network_rate: float = 3e-3
    rate_decay: float = 0.1  # over all iterations
    tv_weight: float = 1e-3
    tv_every: int = 4
    min_weight: float = 2e-3  # samples lighter than this are not kept
    cache_bytes: int = 3 << 30  # a full cache is gone through again instead of growing
    termination: float = 1e-3
    seed: int = 0


@dataclass(frozen=True, slots=True)
class AdaptationPoint:
    """One row of the adaptation curve."""

    iteration: int
    seconds: float
    psnr: float


@dataclass(frozen=True, slots=True)
class RayCache:
    """Rays with their samples' positions and weights, and the colours they should have.

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

    def batch(self, k: int, size: int) -> tuple[Samples, slice]:
        """Returns the samples of the k-th `size` rays, starting over where the rays end."""
        first = k % max(1, len(self.opacity) // size) * size
        last = min(first + size, len(self.opacity))
        offsets = self.offsets[first : last + 1] - self.offsets[first]
        span = slice(int(self.offsets[first]), int(self.offsets[last]))
        ray = torch.repeat_interleave(offsets.diff())
        weights = self.weights[span]
        return Samples(offsets, ray, weights, self.positions[span], weights), slice(first, last)


def adapt_appearance(
    field: RadianceField,
    cameras: Sequence[Camera],
    stylized: UInt8[Tensor, "views height width 3"],
    space: Space,
    config: AdaptationConfig,
    kernels: Kernels,
    progress: Progress = silent,
) -> tuple[list[AdaptationPoint], float]:
    """Fits `field.appearance` to the stylised views, in place; the density is only read.

    Returns:
        The curve, and the mean mass of weights that the cache left out.

    Raises:
        NotFiniteError: The loss stopped being finite.
    """
    generator = torch.Generator().manual_seed(config.seed)
    rays = ViewRays(cameras, space.within(field.bounds), field.step_length, stylized.device)
    cache = march_once(field, rays, stylized, config, kernels, generator)
    optimizer = _optimizer(field.appearance, config)
    curve: list[AdaptationPoint] = []
    smooth, started = 0.0, time.monotonic()
    for k in range(config.iterations):
        samples, drawn = cache.batch(k, config.batch)
        color = _color(field.appearance, kernels, cache, samples, drawn)
        loss = (color - cache.target[drawn]).square().mean()
        mse = float(loss.detach())
        if not math.isfinite(mse):
            raise NotFiniteError("appearance adaptation", "loss", f"iteration {k}")
        if k % config.tv_every == 0:
            smoothness = field.appearance.factors.total_variation()
            loss = loss + config.tv_every * config.tv_weight * smoothness
        for group in optimizer.param_groups:
            group["lr"] = group["initial_rate"] * config.rate_decay ** (k / config.iterations)
        loss.backward()
        optimizer.step()
        optimizer.zero_grad()
        smooth = 0.95 * smooth + 0.05 * mse if k else mse
        psnr = -10 * math.log10(max(smooth, 1e-10))
        if (k + 1) % 20 == 0:
            curve.append(AdaptationPoint(k + 1, time.monotonic() - started, psnr))
        progress(k + 1, config.iterations, psnr=psnr)
    return curve, cache.dropped


@torch.no_grad()
def march_once(
    field: RadianceField,
    rays: ViewRays,
    stylized: UInt8[Tensor, "views height width 3"],
    config: AdaptationConfig,
    kernels: Kernels,
    generator: torch.Generator,
) -> RayCache:
    """Returns the cache of the rays to adapt to: pixels drawn without replacement."""
    march = field.density.march(config.termination)
    draws = torch.randperm(stylized.shape[:3].numel(), generator=generator)
    draws = draws[: config.iterations * config.batch]
    parts: list[tuple[Tensor, ...]] = []
    for draw in draws.to(stylized.device).split(1 << 15):
        segments, target = pixel_rays(rays, stylized, draw)
        jitter = torch.rand(len(segments), generator=generator).to(stylized.device)
        samples = kernels.trace(field.density.factors, segments, jitter, march)
        kept = kernels.heavy(samples, config.min_weight)
        opacity = _mass(samples, kernels)
        kept_mass = _mass(kept, kernels)
        covered = torch.where(kept_mass > 0, opacity, 0)
        weights = kept.weights * (covered / kept_mass.clamp(min=1e-6))[kept.ray]
        parts.append(
            (
                kept.offsets.diff(), kept.positions, weights, segments.view_directions, covered,
                target, opacity - kept_mass,
            )
        )  # fmt: skip
        if sum(part.nbytes for ray_part in parts for part in ray_part) > config.cache_bytes:
            break
    counts, positions, weights, directions, opacity, target, dropped = (
        torch.cat(column) for column in zip(*parts, strict=True)
    )
    offsets = torch.cat([counts.new_zeros(1), counts.cumsum(0)])
    return RayCache(offsets, positions, weights, directions, opacity, target, float(dropped.mean()))


def _mass(samples: Samples, kernels: Kernels) -> Float[Tensor, " rays"]:
    return kernels.composite(samples, torch.ones_like(samples.weights)[:, None])[:, 0]


def _color(
    appearance: Appearance, kernels: Kernels, cache: RayCache, samples: Samples, drawn: slice
) -> Float[Tensor, "rays 3"]:
    components = kernels.features(appearance.factors, samples.positions)
    colors = appearance.shading.decode(
        components, cache.view_directions[drawn], samples.ray, kernels
    )
    color = kernels.composite(samples, colors)
    return color + (1 - cache.opacity[drawn])[:, None] * torch.sigmoid(appearance.background)


def _optimizer(appearance: Appearance, config: AdaptationConfig) -> torch.optim.Adam:
    groups = [
        {"params": [*appearance.factors.parameters()], "initial_rate": config.factor_rate},
        {"params": appearance.network_parameters(), "initial_rate": config.network_rate},
    ]
    return torch.optim.Adam(groups, lr=0.0, betas=(0.9, 0.99), fused=True)
