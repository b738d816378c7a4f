"""Validation views, which show whether a fit still improves views that it is not fitted to.

After the last growth of the lattice, the PSNR of these views is measured twice, a tenth of the
iterations apart. Where it rose by less than `early_gain_db`, more iterations fit the field to the
noise and the gaps of its photographs, and the fit ends a tenth later. Where it rose by at least
`steep_gain_db`, the fit is a quarter longer than planned. Elsewhere it has all of its iterations.
From the second measurement on, it is fitted to all views. Learning rates fall as in a
planned fit. Where it ends early, the average of the last parameters replaces the rest of the fall;
where it is longer, they continue to fall. The first background, free space and the depths are those
of all views throughout.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Int64
from torch import Tensor

from styletrf.capture.view_images import ViewImages
from styletrf.capture.views import places_of
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.geometry.cameras import Camera

_EVERY = 10  # places, of which one has validation views
_LEAST = 2  # places to measure by
_SPACING = 0.1  # of the iterations, from the last growth to each measurement and to the end
_LONGER = 0.25  # of the iterations, by which a fit is longer that improves fast
_PIXELS = 1 << 14  # to measure by


@dataclass(frozen=True, slots=True)
class ValidationViews:
    """Views that are not fitted to at first, pixels of theirs, and the iterations that matter.

    `before` and `after` are those at which PSNR is measured; `early` is the end of a fit that did
    not improve it in between, and `late` that of one that improved it fast.
    """

    views: Bool[Tensor, " views"]
    pixels: Int64[Tensor, " pixels"]
    before: int
    after: int
    early: int
    late: int

    def without(self, images: ViewImages, pixels: Int64[Tensor, " rays"]) -> Int64[Tensor, " kept"]:
        """Returns the pixels that are of other views; all, if none is: a batch is never empty."""
        others = pixels[~self.views[images.places(pixels)[0]]]
        return others if len(others) else pixels

    def end_after(self, gain_db: float, config: FieldTrainingConfig) -> int:
        """Returns the iteration at which a fit ends, from the gain between the measurements."""
        if gain_db < config.early_gain_db:
            return self.early
        is_steep = config.steep_gain_db and gain_db >= config.steep_gain_db
        return self.late if is_steep else config.iterations


def validation_views(
    cameras: Sequence[Camera], images: ViewImages, config: FieldTrainingConfig
) -> ValidationViews | None:
    """Returns every tenth view; None where they, their pixels or the iterations are too few.

    Views of one panorama count as one: each shows the same as the margins of the others.
    """
    fractions = [max((0.0, *config.upsample_at)) + k * _SPACING for k in (1, 2, 3)]
    before, after, early = (round(fraction * config.iterations) for fraction in fractions)
    too_short = not 0 < before < after < early < config.iterations
    if config.early_gain_db == 0 or too_short:
        return None
    places = torch.tensor(places_of(cameras), device=images.device)
    views = places % _EVERY == _EVERY // 2
    if len(places[views].unique()) < _LEAST:
        return None
    drawn = images.spread(0, _PIXELS * _EVERY)
    pixels = drawn[views[images.places(drawn)[0]]]
    late = round((1 + _LONGER) * config.iterations)
    return ValidationViews(views, pixels, before, after, early, late) if len(pixels) else None
