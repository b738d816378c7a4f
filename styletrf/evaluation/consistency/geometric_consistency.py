"""The error of consistency along the field's depth, which is exact and the same for every style.

The cameras and depths of both frames give the path of each pixel from frame to frame
(`exact_flow`), and the pixels that the other frame hides. The measured error is therefore that of
the frames alone, and not a flow estimator's.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float

from styletrf.evaluation.flow import warp_to_a
from styletrf.evaluation.metrics import Image, mean_squared_error
from styletrf.geometry.cameras import Camera, camera_numbers
from styletrf.geometry.exact_flow import exact_flow

Depth = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]
Weights = Float[np.ndarray, "height width"]

_WINDOW_PX = 7
_VARIANCE_OF_ROUNDING = 1 / (12 * 255**2)


@dataclass(frozen=True, slots=True)
class GeometricErrors:
    """Two frames compared in the first one's view; all NaN but the fraction where it is zero.

    Attributes:
        geometric_fraction: The fraction of the pixels whose place the second frame sees.
        geometric_error: The mean square on [0, 1] over these pixels, of the stylized frames.
        geometric_floor: The same of the unstylized frames: resampling, view-dependent color.
        normalized_error: The error in windows over the contrast there, by the scene's detail, see
            `_dissimilarity`: 1 for unrelated pictures whatever their contrast and where they have
            none, at most 2. Equal pictures have 0 between equal cameras, and otherwise the ratio of
            their rounding to their contrast. NaN where the scene has no detail.
        normalized_floor: The same of the unstylized frames.
    """

    geometric_fraction: float
    geometric_error: float
    geometric_floor: float
    normalized_error: float
    normalized_floor: float


@dataclass(frozen=True, slots=True)
class OwnErrors:
    """The same along the stylized field's own depth, where its density has changed (S1, S2).

    All NaN where there is no such depth. The floors are those of `GeometricErrors`.

    Attributes:
        own_fraction: As `geometric_fraction`.
        own_error: As `geometric_error`.
        own_normalized_error: As `normalized_error`.
    """

    own_fraction: float
    own_error: float
    own_normalized_error: float


@dataclass(frozen=True, slots=True)
class Correspondence:
    """The second frame seen from the first, and the pixels where both show the same surface.

    `is_still` says that both cameras are equal, so that nothing moves between them.
    """

    unstylized: Image
    stylized: Image
    seen: Mask
    is_still: bool = False


@dataclass(frozen=True, slots=True)
class _Moments:
    """The mean color about each pixel, and the variance, in a window."""

    mean: Image
    variance: Weights


def corresponding(
    cameras: tuple[Camera, Camera],
    depths: tuple[Depth, Depth],
    unstylized_b: Image,
    stylized_b: Image,
    tolerance: float,
) -> Correspondence:
    """Returns the second frame warped into the first by both depths.

    Depths lie along the cameras' axes, infinite in the sky; they agree within a fraction
    `tolerance`, beyond which the place counts as hidden. Frames are in [0, 1], and so are the
    warped ones. Between pixels they are interpolated by cubics: linear interpolation would blur one
    frame of a pair more, and charge sharp frames for that (decision 45).
    """
    flow, seen = exact_flow(cameras[0], depths[0], cameras[1], depths[1], tolerance)
    there = flow.astype(np.float32)
    unstylized, stylized = (
        warp_to_a(b, there, "cubic")[0].clip(0, 1) for b in (unstylized_b, stylized_b)
    )
    _, numbers = zip(*map(camera_numbers, cameras), strict=True)
    return Correspondence(unstylized, stylized, seen, np.array_equal(*numbers))


def geometric_errors(unstylized_a: Image, stylized_a: Image, b: Correspondence) -> GeometricErrors:
    """Returns the errors of the first frame against the second one warped into it."""
    error = mean_squared_error(b.stylized, stylized_a, b.seen)
    floor = mean_squared_error(b.unstylized, unstylized_a, b.seen)
    moments = _moments(unstylized_a)
    detail = np.where(b.seen, moments.variance, 0)
    plain, painted = (
        _dissimilarity(
            ours, known, np.where(b.seen[..., None], theirs, ours), detail, is_still=b.is_still
        )
        for ours, known, theirs in (
            (unstylized_a, moments, b.unstylized),
            (stylized_a, _moments(stylized_a), b.stylized),
        )
    )
    return GeometricErrors(
        geometric_fraction=float(b.seen.mean()),
        geometric_error=error,
        geometric_floor=floor,
        normalized_error=painted,
        normalized_floor=plain,
    )


def _dissimilarity(
    a: Image, of_a: _Moments, b: Image, weights: Weights, *, is_still: bool
) -> float:
    """The weighted mean over windows of E (a - b)^2 over var a + var b + (E a - E b)^2.

    The structure of SSIM (Wang et al. 2004) without a constant to choose: both sums begin with the
    variance of rounding to 8 bits, so that windows without contrast, which show no motion, are
    unrelated. Where nothing moves, both pictures are rounded alike, and that adds no error.
    """
    total = weights.sum()
    if total <= _VARIANCE_OF_ROUNDING * weights.size:
        return float("nan")
    of_b = _moments(b)
    apart = of_a.variance + of_b.variance + _over_channels((of_a.mean - of_b.mean) ** 2)
    squared = _over_channels((a.astype(np.float64) - b) ** 2)
    noise = 2 * _VARIANCE_OF_ROUNDING
    error = cv2.blur(squared, (_WINDOW_PX, _WINDOW_PX)) + (0.0 if is_still else noise)
    return float((weights * error / (apart + noise)).sum() / total)


def _moments(image: Image) -> _Moments:
    exact = image.astype(np.float64)
    mean = _in_windows(exact)
    return _Moments(mean, _over_channels((_in_windows(exact**2) - mean**2).clip(min=0)))


def _in_windows(image: Image) -> Image:
    mean: Image = cv2.blur(image, (_WINDOW_PX, _WINDOW_PX))
    return mean


def _over_channels(image: Image) -> Weights:
    mean: Weights = (image[..., 0] + image[..., 1] + image[..., 2]) / 3  # faster than over an axis
    return mean
