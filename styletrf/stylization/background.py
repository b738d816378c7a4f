"""Shows a painter objects that are cut out of their background on their own mean color.

A network normalizes a view by the statistics of all of it. Where much of the view is white because
nothing is there, only the object differs from white, and is painted nearly black.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from styletrf.field.rendering import LEAST_OPACITY
from styletrf.files.float_images import FloatImage

Image = Float[np.ndarray, "height width 3"]
Color = Float[np.ndarray, " 3"]

_LEAST_FRACTION = 0.01
"""The fraction of the pixels of all views that have to be empty for such a background."""


@dataclass(frozen=True, slots=True)
class EmptyBackground:
    """The one color of empty pixels, and the mean color of the others.

    Attributes:
        shown: The color of rays that hit nothing.
        mean: The mean color of all else, weighted by opacity.
    """

    shown: Color
    mean: Color

    def covered(self, view: FloatImage) -> FloatImage:
        """Returns the view on the mean color: `C + (1 - opacity) (mean - shown)`."""
        behind = (1 - view.opacity[..., None]) * (self.mean - self.shown)
        return replace(view, color=(view.color + behind).clip(0, 1).astype(np.float32))

    def uncovered(self, painted: Image, view: FloatImage) -> Image:
        """Returns the painted view on its former background: `opacity P + (1 - opacity) shown`."""
        opacity = view.opacity[..., None]
        image: Image = (opacity * painted + (1 - opacity) * self.shown).astype(np.float32)
        return image


def empty_background(views: Iterable[FloatImage]) -> EmptyBackground | None:
    """Returns the background that views share; None where it is too small a part of them to matter.

    Behind a field there is one color, whatever the direction (`volume rendering`), so that it can
    be distinguished from the pixels that show nothing else.
    """
    pixels, empty, opaque = 0, 0, 0.0
    of_empty, of_all = np.zeros(3), np.zeros(3)
    for view in views:
        is_empty = view.opacity < LEAST_OPACITY
        pixels, empty = pixels + is_empty.size, empty + int(is_empty.sum())
        opaque += float(view.opacity.sum(dtype=np.float64))
        of_empty += view.color[is_empty].sum(axis=0, dtype=np.float64)
        of_all += view.color.sum(axis=(0, 1), dtype=np.float64)
    if empty <= _LEAST_FRACTION * pixels or opaque == 0:
        return None
    shown = of_empty / empty
    return EmptyBackground(shown, ((of_all - (pixels - opaque) * shown) / opaque).clip(0, 1))


def replace_background(
    views: Sequence[FloatImage], background: EmptyBackground | None
) -> list[Image]:
    """Returns the views to stylize: on their mean color if they have a background."""
    return [(background.covered(view) if background else view).color for view in views]


def restore_background(
    painted: Sequence[Image], views: Sequence[FloatImage], background: EmptyBackground | None
) -> list[Image]:
    """Returns painted views on the background they had, if they had one."""
    if background is None:
        return list(painted)
    return [background.uncovered(image, view) for image, view in zip(painted, views, strict=True)]
