"""The error of consistency along the field's own depth: the same for every style, and no guess.

The paths of pixels from frame to frame follow from both cameras and depths (`exact_flow`), and so
does what is hidden in the other frame. What is measured is therefore the frames' alone, and not a
flow estimator's.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from styletrf.cameras import Camera
from styletrf.exact_flow import exact_flow
from styletrf.flow import warp_to_a
from styletrf.metrics import Image, mean_squared_error

Depth = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]


@dataclass(frozen=True, slots=True)
class GeometricErrors:
    """Two frames compared in the first one's view; all NaN but the fraction where it is zero.

    Attributes:
        geometric_fraction: Of the pixels, those whose place the second frame sees.
        geometric_error: Mean square on [0, 1] over these pixels, of the stylised frames.
        geometric_floor: The same of the unstylised frames: resampling, view-dependent colour.
        normalized_error: `geometric_error` over the sum of both pictures' variances there: 0 for
            equal pictures, 1 for unrelated ones, whatever their contrast; NaN where they have none.
        normalized_floor: The same of the unstylised frames.
    """

    geometric_fraction: float
    geometric_error: float
    geometric_floor: float
    normalized_error: float
    normalized_floor: float


@dataclass(frozen=True, slots=True)
class Correspondence:
    """The second frame seen from the first, and where it shows what the first one does."""

    unstylized: Image
    stylized: Image
    seen: Mask


def corresponding(
    cameras: tuple[Camera, Camera],
    depths: tuple[Depth, Depth],
    unstylized_b: Image,
    stylized_b: Image,
    tolerance: float,
) -> Correspondence:
    """Returns the second frame warped into the first by both depths.

    Depths lie along the cameras' axes, infinite in the sky; they agree within a fraction
    `tolerance`, beyond which the place counts as hidden.
    """
    flow, seen = exact_flow(cameras[0], depths[0], cameras[1], depths[1], tolerance)
    there = flow.astype(np.float32)
    return Correspondence(warp_to_a(unstylized_b, there)[0], warp_to_a(stylized_b, there)[0], seen)


def geometric_errors(unstylized_a: Image, stylized_a: Image, b: Correspondence) -> GeometricErrors:
    """Returns the errors of the first frame against the second one warped into it."""
    error = mean_squared_error(b.stylized, stylized_a, b.seen)
    floor = mean_squared_error(b.unstylized, unstylized_a, b.seen)
    return GeometricErrors(
        geometric_fraction=float(b.seen.mean()),
        geometric_error=error,
        geometric_floor=floor,
        normalized_error=_by_contrast(error, stylized_a, b.stylized, b.seen),
        normalized_floor=_by_contrast(floor, unstylized_a, b.unstylized, b.seen),
    )


def _by_contrast(error: float, a: Image, b: Image, seen: Mask) -> float:
    """The error over the variances about the mean colours: E (a - b)^2 of unrelated pictures."""
    if not seen.any():
        return float("nan")
    contrast = sum(float(p[seen].astype(np.float64).var(axis=0).mean()) for p in (a, b))
    return error / contrast if contrast > 0 else float("nan")
