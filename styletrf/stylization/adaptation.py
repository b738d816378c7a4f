"""Adapts a field's appearance to stylized views, its density frozen (StyleTRF section 4.3).

With the density frozen the samples and weights of a ray never change, so a ray is marched once and
only the samples that carry its weight are kept; an iteration then costs an appearance look-up and
the color network.

One view fixes only the sum along each of its rays. Where the density is spread along a ray, its
samples could differ wildly, and another view would show them as noise. So every sample is fitted to
the color of its ray. The losses are means over the rays of

    samples: sum_s w_s |c_s - C|^2,     rays (as published): |sum_s w_s c_s - C|^2.

By Jensen's inequality the first bounds the second where rays are opaque. One sample of each ray,
drawn by its weight, estimates the first; without bias where rays are opaque.
"""

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Literal

import torch
from jaxtyping import Int64, UInt8
from torch import Tensor, nn

from styletrf.capture.view_images import view_images
from styletrf.configuration import SEEDS, require_at_least, require_within
from styletrf.field.appearance import Appearance
from styletrf.field.kernels import Kernels
from styletrf.field.radiance_field import RadianceField
from styletrf.field.ray_cache import RayBatch, march_once
from styletrf.field.training.diagnostics import batch_stages
from styletrf.field.training.optimizer import take_step
from styletrf.field.view_rays import ViewRays
from styletrf.finiteness import parameter_stages, require_finite
from styletrf.geometry.cameras import Camera
from styletrf.geometry.space import Space
from styletrf.progress import Progress, silent
from styletrf.psnr import bounded_psnr

PARTS = ("factors", "basis", "network", "background")
"""The parts of an appearance."""

_CURVE_EVERY = 20  # iterations


@dataclass(frozen=True, slots=True)
class AdaptationConfig:
    """Settings of the adaptation of the appearance."""

    iterations: int = 400
    batch: int = 16384  # rays an iteration
    fitted: Literal["samples", "rays"] = "samples"  # to the painted colors
    parts: tuple[str, ...] = PARTS  # which are adapted
    sees_view: bool = False  # whether a color may depend on the direction it is seen from
    factor_rate: float = 0.1
    network_rate: float = 3e-3
    rate_decay: float = 0.1  # over all iterations
    tv_weight: float = 1e-4
    tv_every: int = 4
    min_weight: float = 1e-2  # samples lighter than this are not kept
    cache_bytes: int = 3 << 30  # a full cache is gone through again instead of growing
    termination: float = 1e-3
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.parts or not set(self.parts) <= set(PARTS):
            raise ValueError(f"parts are {self.parts}, not some of {PARTS}")
        require_within(SEEDS, self, "seed")
        require_at_least(1, self, "iterations", "batch", "tv_every", "cache_bytes")
        require_within("(0, inf)", self, "factor_rate", "network_rate")
        require_within("(0, 1]", self, "rate_decay")
        require_within("[0, inf)", self, "tv_weight")
        require_within("[0, 1)", self, "min_weight", "termination")


@dataclass(frozen=True, slots=True)
class AdaptationCurvePoint:
    """One row of the adaptation curve; the grid has one size, so no column has it."""

    iteration: int
    seconds: float
    psnr: float  # of the colors of a batch of rays


def adapt_appearance(
    field: RadianceField,
    cameras: Sequence[Camera],
    stylized: UInt8[Tensor, "views height width 3"],
    space: Space,
    config: AdaptationConfig,
    kernels: Kernels,
    progress: Progress = silent,
    pixels: Int64[Tensor, " pixels"] | None = None,
) -> tuple[list[AdaptationCurvePoint], float]:
    """Fits `field.appearance` to the stylized views, in place; the density is only read.

    Pixels are drawn without replacement until all were; then they are gone through again.

    Args:
        field: The field.
        cameras: The cameras of the views.
        stylized: The views.
        space: The space of the scene.
        config: The settings of the adaptation.
        kernels: The backend to compute with.
        progress: Called with the iteration and the loss.
        pixels: Those to learn from, by their numbers; all of them where not given.

    Returns:
        The curve, and the mean mass of weights that the cache left out.

    Raises:
        NotFiniteError: A tensor stopped being finite; the error names the first one.
    """
    started = time.monotonic()
    generator = torch.Generator().manual_seed(config.seed)
    rays = ViewRays(cameras, space.within(field.bounds), field.step_length, stylized.device)
    images = view_images(stylized)
    if pixels is None:
        pixels = torch.arange(len(images))
    draws = pixels[torch.randperm(len(pixels), generator=generator)]
    cache = march_once(
        field, rays, images, draws[: config.iterations * config.batch], kernels,
        min_weight=config.min_weight, termination=config.termination,
        cache_bytes=config.cache_bytes, generator=generator,
    )  # fmt: skip
    batches = (cache.batch(k, config.batch) for k in range(config.iterations))
    curve = fit_appearance(field.appearance, batches, config, kernels, progress, started)
    return curve, cache.dropped


def fit_appearance(
    appearance: Appearance,
    batches: Iterator[RayBatch],
    config: AdaptationConfig,
    kernels: Kernels,
    progress: Progress = silent,
    started: float | None = None,
) -> list[AdaptationCurvePoint]:
    """Fits the appearance to batches of rays, in place, and returns the curve.

    Args:
        appearance: The appearance to fit.
        batches: One for each iteration.
        config: The settings of the adaptation.
        kernels: The backend to compute with.
        progress: Called with the iteration and the loss.
        started: The time from which the seconds of the curve count; by default now.

    Raises:
        NotFiniteError: A tensor stopped being finite; the error names the first one.
    """
    started = time.monotonic() if started is None else started
    if not config.sees_view:
        appearance.shading.freeze_view_dependence()
    optimizer = optimizer_of(appearance, config)
    generator = torch.Generator().manual_seed(config.seed)
    curve: list[AdaptationCurvePoint] = []
    for k, batch in enumerate(batches):
        fitted = batch.one_sample_per_ray(generator) if config.fitted == "samples" else batch
        error = fitted.error(appearance, kernels)
        loss = float(error.detach())
        if not math.isfinite(loss):
            left = parameter_stages(appearance, optimizer)
            named = chain(
                left, batch_stages(appearance, kernels, fitted), [("loss", error.detach())]
            )
            require_finite("appearance adaptation", f"at iteration {k}", named)
        error.backward()
        if k % config.tv_every == 0 and config.tv_weight > 0:
            appearance.factors.add_total_variation_gradient(config.tv_every * config.tv_weight)
        take_step(optimizer, config.rate_decay ** (k / config.iterations))
        if (k + 1) % _CURVE_EVERY == 0:
            psnr = _psnr(batch, appearance, kernels)
            curve.append(AdaptationCurvePoint(k + 1, time.monotonic() - started, psnr))
        progress(k + 1, config.iterations, loss=loss)
    left = parameter_stages(appearance, optimizer)
    require_finite("appearance adaptation", "after the last iteration", left)
    return curve


@torch.no_grad()
def _psnr(batch: RayBatch, appearance: Appearance, kernels: Kernels) -> float:
    return bounded_psnr(float(batch.error(appearance, kernels)))


def optimizer_of(appearance: Appearance, config: AdaptationConfig) -> torch.optim.Adam:
    """Returns an optimizer of the parts that are adapted, and freezes the others."""
    basis = [*appearance.shading.basis.parameters()]
    rest = [p for p in appearance.shading.parameters() if all(p is not b for b in basis)]
    parts: dict[str, list[nn.Parameter]] = {
        "factors": [*appearance.factors.parameters()],
        "basis": basis,
        "network": rest,
        "background": [appearance.background],
    }
    appearance.requires_grad_(requires_grad=False)
    groups = []
    for name in config.parts:
        for parameter in parts[name]:
            parameter.requires_grad_()
        rate = config.factor_rate if name == "factors" else config.network_rate
        groups.append({"params": parts[name], "initial_rate": rate})
    return torch.optim.Adam(groups, lr=0.0, betas=(0.9, 0.99), fused=True)
