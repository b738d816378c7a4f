"""Windows of views, with the rays and the content features that a loss of renders needs.

The window of a small view is the whole view: it is marched once, and kept with its content features
while memory allows. The window of a large view lies at another place every time.
"""

from dataclasses import dataclass
from dataclasses import field as dataclass_field
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float, Int64, UInt8
from torch import Tensor

from styletrf.capture.view_images import ViewImages
from styletrf.field.kernels import Kernels
from styletrf.field.radiance_field import RadianceField
from styletrf.field.ray_cache import RayCache, march_once
from styletrf.field.view_rays import ViewRays
from styletrf.stylization.background import EmptyBackground


@runtime_checkable
class ImageLoss(Protocol):
    """A loss of renders, `1 3 height width`, against the content that they are to show."""

    def content_features(self, unstylized: Tensor) -> Tensor:
        """Returns the features of an unstylized render that the loss compares with."""

    def __call__(self, image: Tensor, features: Tensor, generator: torch.Generator) -> Tensor:
        """Returns the loss, differentiable in the image; called once for each iteration."""


@dataclass(frozen=True, slots=True)
class Window:
    """A part of a view: its rows and columns, and the painted view in it."""

    rows: slice
    columns: slice
    painted: Float[Tensor, "height width 3"]
    is_whole: bool

    def pixels(self, of_view: Int64[Tensor, "rows columns"]) -> Int64[Tensor, " pixels"]:
        """Returns the numbers of the window's pixels, row by row."""
        return of_view[self.rows, self.columns].reshape(-1)


def drawn_window(
    painted: UInt8[Tensor, "height width 3"], side_px: int, generator: torch.Generator
) -> Window:
    """Returns a window at a random place; the whole view if that is smaller."""
    spans = []
    for whole in painted.shape[:2]:
        side = min(whole, side_px)
        first = int(torch.randint(whole - side + 1, (), generator=generator))
        spans.append(slice(first, first + side))
    rows, columns = spans
    part = painted[rows, columns].float() / 255
    return Window(rows, columns, part, is_whole=part.shape == painted.shape)


@dataclass(frozen=True, slots=True)
class MarchedWindow:
    """The rays of a window, the color added behind them, and the window's content features."""

    rays: RayCache
    behind: Float[Tensor, "1 3 height width"]
    content_features: Tensor

    @property
    def nbytes(self) -> int:
        """The bytes of memory that it takes."""
        return self.rays.nbytes + self.behind.nbytes + self.content_features.nbytes


@dataclass(frozen=True, slots=True)
class MarchedWindows:
    """Windows of views by a loss; those that are whole views are kept, up to `most_bytes`."""

    field: RadianceField
    rays: ViewRays
    images: ViewImages
    kernels: Kernels
    loss: ImageLoss
    background: EmptyBackground | None
    min_weight: float
    termination: float
    most_bytes: int
    kept: dict[int, MarchedWindow] = dataclass_field(default_factory=dict)

    def of(self, view: int, window: Window) -> MarchedWindow:
        """Returns the rays of a window, with the samples that carry their weight."""
        if view in self.kept:
            return self.kept[view]
        cache, shape = self._marched(view, window), window.painted.shape
        behind = as_picture(_in_place_of_background(cache, self.background).reshape(shape))
        shown = as_picture(cache.target.reshape(shape)) + behind
        marched = MarchedWindow(cache, behind, self.loss.content_features(shown))
        if window.is_whole and sum(m.nbytes for m in self.kept.values()) < self.most_bytes:
            self.kept[view] = marched
        return marched

    def _marched(self, view: int, window: Window) -> RayCache:
        of_view = self.images.of_view(view).reshape(-1, int(self.images.widths[view]))
        return march_once(
            self.field, self.rays, self.images, window.pixels(of_view), self.kernels,
            min_weight=self.min_weight, termination=self.termination,
            cache_bytes=1 << 62,
        )  # fmt: skip


def as_picture(colors: Float[Tensor, "height width 3"]) -> Float[Tensor, "1 3 height width"]:
    """Returns colors of pixels as networks take them."""
    return colors.permute(2, 0, 1)[None]


def _in_place_of_background(
    cache: RayCache, background: EmptyBackground | None
) -> Float[Tensor, "rays 3"]:
    """Returns the change of each ray's color if the background had its mean color; 0 without."""
    behind = (1 - cache.opacity)[:, None]
    if background is None:
        return torch.zeros_like(cache.target)
    return behind * torch.from_numpy(background.mean - background.shown).to(behind)
