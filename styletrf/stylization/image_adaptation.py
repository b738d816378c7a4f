"""Adapting an appearance to a loss of whole renders, by deferred back-propagation.

As in ARF (Zhang et al., ECCV 2022, section 4.2): a view is rendered without gradients, the loss of
the whole image tells each pixel's gradient, and the view is rendered again tile by tile to take it
to the parameters: of the renders' graphs only a tile's is in memory.
"""

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain

import torch
from jaxtyping import Float, UInt8
from torch import Tensor
from torch.nn import functional

from styletrf.capture.view_images import ViewImages, view_images
from styletrf.field.kernels import Kernels
from styletrf.field.radiance_field import RadianceField
from styletrf.field.ray_cache import RayCache, march_once
from styletrf.field.training.diagnostics import batch_stages
from styletrf.field.training.optimizer import take_step
from styletrf.field.view_rays import ViewRays
from styletrf.finiteness import Named, parameter_stages, require_finite
from styletrf.geometry.cameras import Camera
from styletrf.geometry.space import Space
from styletrf.progress import Progress, silent
from styletrf.style.perceptual.perceptual_loss import relative_difference
from styletrf.stylization.adaptation import AdaptationConfig, AdaptationPoint, optimizer_of

ImageLoss = Callable[[Tensor, Tensor], Tensor]
"""From a render and the unpainted render, `1 3 height width`, to a loss."""

_TILE = 1 << 14
_PARTS = 24


@dataclass(frozen=True, slots=True)
class ImageAdaptationConfig:
    """How often, and how fast compared with the adaptation to pixels before.

    A loss of strokes says little of color, which drifts towards the photographs' or to gray:
    `color_weight` is that of the drift, see `color_drift`.
    """

    iterations: int = 60  # a view each
    rate: float = 0.2  # times those of the adaptation
    color_weight: float = 20.0


def adapt_to_image_loss(
    field: RadianceField,
    cameras: Sequence[Camera],
    views: tuple[UInt8[Tensor, "views height width 3"], UInt8[Tensor, "views height width 3"]],
    space: Space,
    image_loss: ImageLoss,
    config: ImageAdaptationConfig,
    adaptation: AdaptationConfig,
    kernels: Kernels,
    progress: Progress = silent,
) -> list[AdaptationPoint]:
    """Moves `field.appearance` down the loss of whole renders, in place.

    Args:
        field: The field; its density is only read.
        cameras: Of the views.
        views: The plain views, and the painted ones, which the curve compares with.
        space: Of the scene.
        image_loss: Of a render and the plain view.
        config: How long.
        adaptation: Rates, parts and the cache.
        kernels: The form to compute with.
        progress: Called with the iteration and the loss.

    Returns:
        The curve.

    Raises:
        NotFiniteError: Something stopped being finite; it names what did first, and the view.
    """
    plain, painted = views
    rays = ViewRays(cameras, space.within(field.bounds), field.step_length, plain.device)
    images = view_images(plain)
    optimizer = optimizer_of(field.appearance, _at_rate(adaptation, config.rate))
    curve, started = [], time.monotonic()
    for k, view in enumerate(_order_of_views(len(plain), config.iterations, adaptation.seed)):
        cache = _view_cache(field, rays, images, view, adaptation, kernels)
        shape = plain.shape[1:]
        target = painted[view].float() / 255
        held = partial(_with_colors_held, image_loss, target, config.color_weight)
        loss, image = _accumulate(field, cache, shape, held, kernels)
        mse = float((image - target).square().mean())
        if not math.isfinite(loss):
            tiles = (batch_stages(field.appearance, kernels, t) for t in cache.tiles(_TILE))
            sums = [("image loss", torch.tensor(loss))]
            where = f"at iteration {k}, view {cameras[view].name}"
            _require_finite(where, parameter_stages(field.appearance, optimizer), *tiles, sums)
        take_step(optimizer, adaptation.rate_decay ** (k / config.iterations))
        psnr = -10 * math.log10(max(mse, 1e-10))
        curve.append(AdaptationPoint(k + 1, time.monotonic() - started, psnr))
        progress(k + 1, config.iterations, loss=loss)
    _require_finite("after the last iteration", parameter_stages(field.appearance, optimizer))
    return curve


def _at_rate(adaptation: AdaptationConfig, rate: float) -> AdaptationConfig:
    """Returns the configuration with its learning rates multiplied."""
    factors, network = rate * adaptation.factor_rate, rate * adaptation.network_rate
    return replace(adaptation, factor_rate=factors, network_rate=network)


def _order_of_views(n_views: int, iterations: int, seed: int) -> list[int]:
    """Every view once in a new order, again and again."""
    order, rounds = torch.Generator().manual_seed(seed), 1 + iterations // n_views
    orders = torch.cat([torch.randperm(n_views, generator=order) for _ in range(rounds)])
    return [int(view) for view in orders[:iterations]]


def _require_finite(where: str, *stages: Iterable[Named]) -> None:
    require_finite("appearance adaptation", where, chain(*stages))


def color_drift(
    image: Float[Tensor, "1 3 height width"], painted: Float[Tensor, "1 3 height width"]
) -> Float[Tensor, ""]:
    """Returns how far the mean colors of 24x24 parts are from those of the painted view.

    `log(1 + d / t)`, `d` the mean squared difference, `t` the mean square of the target.
    Differentiable.
    """
    parts = [functional.adaptive_avg_pool2d(i, _PARTS) for i in (image, painted)]
    return relative_difference(*parts)


def _with_colors_held(
    image_loss: ImageLoss, painted: Tensor, weight: float, image: Tensor, plain: Tensor
) -> Tensor:
    drift = color_drift(image, painted.permute(2, 0, 1)[None])
    return image_loss(image, plain) + weight * drift


def _view_cache(
    field: RadianceField, rays: ViewRays, plain: ViewImages, view: int, config: AdaptationConfig,
    kernels: Kernels,
) -> RayCache:  # fmt: skip
    return march_once(
        field, rays, plain, plain.of_view(view), kernels, min_weight=config.min_weight,
        termination=config.termination, cache_bytes=1 << 62,
    )  # fmt: skip


def _accumulate(
    field: RadianceField, cache: RayCache, shape: Sequence[int], image_loss: ImageLoss,
    kernels: Kernels,
) -> tuple[float, Tensor]:  # fmt: skip
    """Adds the gradient of one view's loss to the appearance; returns it and the render."""
    with torch.no_grad():
        colors = [tile.color(field.appearance, kernels) for tile in cache.tiles(_TILE)]
        image = torch.cat(colors).reshape(shape)
    image.requires_grad_()
    plain = cache.target.reshape(shape)
    first = image.permute(2, 0, 1)[None]
    loss = image_loss(first, plain.permute(2, 0, 1)[None])
    (gradient,) = torch.autograd.grad(loss, image)
    of_tiles = gradient.reshape(-1, 3).split(_TILE)
    for tile, part in zip(cache.tiles(_TILE), of_tiles, strict=True):
        tile.color(field.appearance, kernels).backward(part)
    return float(loss.detach()), image.detach()
