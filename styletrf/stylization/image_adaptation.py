"""Adapts an appearance to a loss of renders, by deferred back-propagation.

As in ARF (Zhang et al., ECCV 2022, section 4.2): a part of a view is rendered without gradients,
the loss of that picture gives each pixel's gradient, and the part is rendered again tile by tile to
take it to the parameters: of the renders' graphs only a tile's is in memory. A view is looked at
whole; of one with a longer side than `window_px` a window is, drawn again for every iteration.

A picture fixes only the sum along each ray, as in `styletrf.stylization.adaptation`. So the loss
also has the variance of the color along the rays: it keeps strokes on their surface, and frames
consistent.
"""

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain

import torch
from jaxtyping import UInt8
from torch import Tensor

from styletrf.capture.view_images import view_images
from styletrf.configuration import require_at_least, require_within
from styletrf.field.kernels import Kernels
from styletrf.field.radiance_field import RadianceField
from styletrf.field.ray_cache import RayCache
from styletrf.field.training.diagnostics import batch_stages
from styletrf.field.training.optimizer import take_step
from styletrf.field.view_rays import ViewRays
from styletrf.finiteness import Named, parameter_stages, require_finite
from styletrf.geometry.cameras import Camera
from styletrf.geometry.space import Space
from styletrf.progress import Progress, silent
from styletrf.psnr import bounded_psnr
from styletrf.style.perceptual.perceptual_loss import color_drift
from styletrf.style.perceptual.predictor_features import LEAST_PX
from styletrf.stylization.adaptation import AdaptationConfig, AdaptationCurvePoint, optimizer_of
from styletrf.stylization.background import EmptyBackground
from styletrf.stylization.view_windows import (
    ImageLoss,
    MarchedWindow,
    MarchedWindows,
    Window,
    as_picture,
    drawn_window,
)

_TILE = 1 << 15  # rays; each tile fills gradients of all planes once, so small ones take time
_PARTS = 24
"""The number of blocks along the longer side of a view whose mean colors are held."""


@dataclass(frozen=True, slots=True)
class ImageAdaptationConfig:
    """The iterations and rates of the adaptation to images, which follows that to pixels.

    A loss of strokes says little of color, which drifts towards the photographs' or to gray:
    `color_weight` is that of the drift, see `color_drift`; `variance_weight` that of the mean
    variance of the color along a ray.
    """

    iterations: int = 75  # a view each
    window_px: int = 1024  # of a view with longer sides only a window is looked at
    rate: float = 1.0  # times those of the adaptation
    rate_decay: float = 0.3  # over all iterations
    color_weight: float = 3.0
    variance_weight: float = 30.0
    min_weight: float = 5e-2  # samples lighter than this are not rendered
    termination: float = 5e-2  # see `RenderConfig`

    def __post_init__(self) -> None:
        require_at_least(0, self, "iterations")
        require_at_least(LEAST_PX, self, "window_px")
        require_within("(0, inf)", self, "rate")
        require_within("(0, 1]", self, "rate_decay")
        require_within("[0, inf)", self, "color_weight", "variance_weight")
        require_within("[0, 1)", self, "min_weight", "termination")


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
    background: EmptyBackground | None = None,
) -> list[AdaptationCurvePoint]:
    """Moves `field.appearance` down the loss of whole renders, in place.

    Args:
        field: The field; its density is only read.
        cameras: The cameras of the views.
        views: The unstylized views, and the painted ones, which the curve compares with.
        space: The space of the scene.
        image_loss: The loss of a render and the content features of the unstylized view.
        config: The iterations and rates.
        adaptation: The rates, the parts and the cache.
        kernels: The backend to compute with.
        progress: Called with the iteration and the loss.
        background: The background of views that show an object on nothing: the loss sees it on its
            mean color, as the painter of the views did.

    Returns:
        The curve.

    Raises:
        NotFiniteError: A tensor stopped being finite; the error names the first one and its view.
    """
    unstylized, painted = views
    rays = ViewRays(cameras, space.within(field.bounds), field.step_length, unstylized.device)
    optimizer = optimizer_of(field.appearance, _at_rate(adaptation, config.rate))
    parameters = partial(parameter_stages, field.appearance, optimizer)
    curve, started = [], time.monotonic()
    limits = config.min_weight, config.termination, adaptation.cache_bytes
    images = view_images(unstylized)
    windows = MarchedWindows(field, rays, images, kernels, image_loss, background, *limits)
    generator = torch.Generator().manual_seed(adaptation.seed)
    block_px = max(1, max(unstylized.shape[1:3]) // _PARTS)
    for k, view in enumerate(_order_of_views(len(unstylized), config.iterations, adaptation.seed)):
        window = drawn_window(painted[view], config.window_px, generator)
        marched = windows.of(view, window)
        held = marched, window, generator, block_px, config.color_weight
        of_picture = partial(_loss_with_colors_held, image_loss, *held)
        cache, shape, weight = marched.rays, window.painted.shape, config.variance_weight
        loss, image = accumulate_gradient(field, cache, shape, of_picture, kernels, weight)
        if not math.isfinite(loss):
            where = f"at iteration {k}, view {cameras[view].name}"
            tiles = (batch_stages(field.appearance, kernels, t) for t in cache.tiles(_TILE))
            _require_finite(where, parameters(), *tiles, [("image loss", torch.tensor(loss))])
        take_step(optimizer, config.rate_decay ** (k / config.iterations))
        psnr = _psnr(image, window.painted)
        curve.append(AdaptationCurvePoint(k + 1, time.monotonic() - started, psnr))
        progress(k + 1, config.iterations, loss=loss)
    _require_finite("after the last iteration", parameters())
    return curve


def _psnr(image: Tensor, painted: Tensor) -> float:
    return bounded_psnr(float((image - painted).square().mean()))


def _at_rate(adaptation: AdaptationConfig, rate: float) -> AdaptationConfig:
    """Returns the configuration with its learning rates multiplied."""
    factors, network = rate * adaptation.factor_rate, rate * adaptation.network_rate
    return replace(adaptation, factor_rate=factors, network_rate=network)


def _order_of_views(n_views: int, iterations: int, seed: int) -> list[int]:
    """Yields every view once in a new order, again and again."""
    order, rounds = torch.Generator().manual_seed(seed), 1 + iterations // n_views
    orders = torch.cat([torch.randperm(n_views, generator=order) for _ in range(rounds)])
    return [int(view) for view in orders[:iterations]]


def _require_finite(where: str, *stages: Iterable[Named]) -> None:
    require_finite("appearance adaptation", where, chain(*stages))


def _loss_with_colors_held(
    image_loss: ImageLoss, marched: MarchedWindow, window: Window, generator: torch.Generator,
    block_px: int, color_weight: float, image: Tensor,
) -> Tensor:  # fmt: skip
    """Returns the loss of the picture, and of its drift from the painted one."""
    drift = color_drift(image, as_picture(window.painted), block_px)
    return (
        image_loss(image + marched.behind, marched.content_features, generator)
        + color_weight * drift
    )


def accumulate_gradient(
    field: RadianceField, cache: RayCache, shape: Sequence[int],
    image_loss: Callable[[Tensor], Tensor], kernels: Kernels, variance_weight: float,
) -> tuple[float, Tensor]:  # fmt: skip
    """Adds the gradient of one picture's loss to the appearance; returns it and the render.

    The loss includes the mean variance of the color along the rays, by its weight.
    """
    with torch.no_grad():
        colors = [tile.color(field.appearance, kernels) for tile in cache.tiles(_TILE)]
        image = torch.cat(colors).reshape(shape)
    image.requires_grad_()
    loss = image_loss(as_picture(image))
    (gradient,) = torch.autograd.grad(loss, image)
    total, of_tiles = loss.detach(), gradient.reshape(-1, 3).split(_TILE)
    for tile, part in zip(cache.tiles(_TILE), of_tiles, strict=True):
        color, variance = tile.color_and_variance(field.appearance, kernels)
        weighted = variance_weight / len(cache.opacity) * variance.sum()
        ((color * part).sum() + weighted).backward()
        total = total + weighted.detach()
    return float(total), image.detach()
