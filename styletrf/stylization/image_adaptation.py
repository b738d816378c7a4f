"""Adapting an appearance to a loss of renders, by deferred back-propagation.

As in ARF (Zhang et al., ECCV 2022, section 4.2): a part of a view is rendered without gradients,
the loss of that picture tells each pixel's gradient, and the part is rendered again tile by tile to
take it to the parameters: of the renders' graphs only a tile's is in memory. A view is looked at
whole; of one with a longer side than `window_px` a window is, drawn anew for every iteration.
"""

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from functools import partial
from itertools import chain

import torch
from jaxtyping import Float, Int64, UInt8
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
from styletrf.style.perceptual.predictor_features import LEAST_PX
from styletrf.stylization.adaptation import AdaptationConfig, AdaptationPoint, optimizer_of
from styletrf.stylization.background import EmptyBackground

ImageLoss = Callable[[Tensor, Tensor, torch.Generator], Tensor]
"""From a render and the plain render, `1 3 height width`, and a generator to a loss."""

_TILE = 1 << 14
_PARTS = 24
"""The number of blocks along the longer side of a view whose mean colors are held."""


@dataclass(frozen=True, slots=True)
class ImageAdaptationConfig:
    """How often, and how fast compared with the adaptation to pixels before.

    A loss of strokes says little of color, which drifts towards the photographs' or to gray:
    `color_weight` is that of the drift, see `color_drift`.
    """

    iterations: int = 30  # a view each
    window_px: int = 1024  # of a view with longer sides only a window is looked at
    rate: float = 1.0  # times those of the adaptation
    color_weight: float = 5.0
    min_weight: float = 5e-2  # samples lighter than this are not rendered
    termination: float = 5e-2  # see `RenderConfig`

    def __post_init__(self) -> None:
        if self.window_px < LEAST_PX:
            raise ValueError(f"window_px is at least {LEAST_PX}")


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
    ground: EmptyBackground | None = None,
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
        ground: Of views that show an object on nothing: the loss sees it on its mean color, as what
            painted the views did.

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
    marched = _MarchedViews(field, rays, images, kernels, config, adaptation.cache_bytes)
    generator = torch.Generator().manual_seed(adaptation.seed)
    block_px = max(1, max(plain.shape[1:3]) // _PARTS)
    for k, view in enumerate(_order_of_views(len(plain), config.iterations, adaptation.seed)):
        window = _drawn_window(painted[view], config.window_px, generator)
        cache = marched.rays_of(view, window)
        held = _held(cache, window, ground), block_px, config.color_weight
        of_picture = partial(_loss_with_colors_held, image_loss, generator, *held)
        loss, image = _accumulate(field, cache, window.painted.shape, of_picture, kernels)
        if not math.isfinite(loss):
            stages = (batch_stages(field.appearance, kernels, t) for t in cache.tiles(_TILE))
            left = parameter_stages(field.appearance, optimizer)
            where = f"at iteration {k}, view {cameras[view].name}"
            _require_finite(where, left, *stages, [("image loss", torch.tensor(loss))])
        take_step(optimizer, adaptation.rate_decay ** (k / config.iterations))
        mse = float((image - window.painted).square().mean())
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
    image: Float[Tensor, "1 3 height width"],
    painted: Float[Tensor, "1 3 height width"],
    block_px: int,
) -> Float[Tensor, ""]:
    """Returns how far the mean colors of square blocks are from those of the painted picture.

    `log(1 + d / t)`, `d` the mean squared difference, `t` the mean square of the target.
    Blocks at the right and at the bottom may be smaller. Differentiable.
    """
    side = min(block_px, *image.shape[2:])
    blocks = [functional.avg_pool2d(p, side, ceil_mode=True) for p in (image, painted)]
    return relative_difference(*blocks)


def _loss_with_colors_held(
    image_loss: ImageLoss, generator: torch.Generator, held: tuple[Tensor, Tensor],
    block_px: int, color_weight: float, image: Tensor, plain: Tensor,
) -> Tensor:  # fmt: skip
    """Returns the loss of the picture and the plain one, and of its drift from the painted one."""
    painted, behind = held
    drift = color_drift(image, painted, block_px)
    return image_loss(image + behind, plain + behind, generator) + color_weight * drift


def _held(
    cache: RayCache, window: "_Window", ground: EmptyBackground | None
) -> tuple[Tensor, Tensor]:
    """Returns the painted window, and what is added where its views have an empty ground."""
    behind = _in_place_of_ground(cache, ground).reshape(window.painted.shape)
    painted, added = (picture.permute(2, 0, 1)[None] for picture in (window.painted, behind))
    return painted, added


def _in_place_of_ground(cache: RayCache, ground: EmptyBackground | None) -> Float[Tensor, "rays 3"]:
    """Returns what takes rays from the ground of the views to the mean color: 0 without one."""
    behind = (1 - cache.opacity)[:, None]
    if ground is None:
        return torch.zeros_like(cache.target)
    return behind * torch.from_numpy(ground.mean - ground.shown).to(behind)


@dataclass(frozen=True, slots=True)
class _Window:
    """A part of a view: its rows and columns, and the painted view in it."""

    rows: slice
    columns: slice
    painted: Float[Tensor, "height width 3"]
    is_whole: bool

    def pixels(self, of_view: Int64[Tensor, "rows columns"]) -> Int64[Tensor, " pixels"]:
        """Returns the numbers of the window's pixels, row by row."""
        return of_view[self.rows, self.columns].reshape(-1)


def _drawn_window(
    painted: UInt8[Tensor, "height width 3"], side_px: int, generator: torch.Generator
) -> _Window:
    """Returns a window at a random place; a view that is smaller is taken whole."""
    spans = []
    for whole in painted.shape[:2]:
        side = min(whole, side_px)
        first = int(torch.randint(whole - side + 1, (), generator=generator))
        spans.append(slice(first, first + side))
    rows, columns = spans
    part = painted[rows, columns].float() / 255
    return _Window(rows, columns, part, is_whole=part.shape == painted.shape)


@dataclass(frozen=True, slots=True)
class _MarchedViews:
    """The rays of windows; those of a view that is looked at whole are marched once and kept."""

    field: RadianceField
    rays: ViewRays
    images: ViewImages
    kernels: Kernels
    config: ImageAdaptationConfig
    most_bytes: int
    kept: dict[int, RayCache] = dataclass_field(default_factory=dict)

    def rays_of(self, view: int, window: _Window) -> RayCache:
        """Returns the rays through a window, with the samples that carry their weight."""
        if view in self.kept:
            return self.kept[view]
        of_view = self.images.of_view(view).reshape(-1, int(self.images.widths[view]))
        cache = march_once(
            self.field, self.rays, self.images, window.pixels(of_view), self.kernels,
            min_weight=self.config.min_weight, termination=self.config.termination,
            cache_bytes=1 << 62,
        )  # fmt: skip
        if window.is_whole and sum(c.nbytes for c in self.kept.values()) < self.most_bytes:
            self.kept[view] = cache
        return cache


def _accumulate(
    field: RadianceField, cache: RayCache, shape: Sequence[int],
    image_loss: Callable[[Tensor, Tensor], Tensor], kernels: Kernels,
) -> tuple[float, Tensor]:  # fmt: skip
    """Adds the gradient of one picture's loss to the appearance; returns it and the render."""
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
