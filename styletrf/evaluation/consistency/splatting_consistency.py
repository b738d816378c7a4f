"""The consistency protocol of papers since 2025: splat one frame along the flow to another.

Stylos (ICLR 2026) and AnyStyle (arXiv 2602.04043, appendix E) move stylized frame t along its own
flow to frame t + 1 or t + 7 by softmax splatting (Niklaus and Liu, CVPR 2020), and compare it with
that frame. Both publish the same code, and this file computes the same, also where it surprises. It
differs from the error of `flow_consistency` in all of this: the flow is that of the stylized
frames, which follows flicker; pixels that nothing is splatted to count as errors of zero, so that
more disocclusion lowers the figure; and so do pixels that something black is splatted to.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from types import MappingProxyType

import numpy as np
import torch
from jaxtyping import Bool, Float

from styletrf.evaluation.flow import Flow, Image
from styletrf.finiteness import require_finite
from styletrf.geometry.tensor_sampling import sample_tensor_at

GAPS = 1, 7
FIRST_FRAMES = 16  # of the published figures
RAFT_UPDATES = 32  # of the flow, in the published code
_LEVELS = 255  # of a channel of 8 bits
_SHARPNESS, _MOST = 10.0, 10.0  # of the published importance
_LEAST_SUM = 1e-7  # that the published splatting adds to the sum of weights

FlowBetween = Callable[[Image, Image], Flow]
Distance = Callable[[Image, Image], float]
NO_DISTANCES: Mapping[str, Distance] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class SplattingErrors:
    """Frame a, splatted to frame b, compared with it on [0, 1].

    Attributes:
        rmse: As published: over all pixels, those that nothing or only black reaches counted as
            equal.
        covered_rmse: The same over the pixels that something reaches; NaN if nothing reaches any.
        covered_fraction: The fraction of the pixels that something reaches.
        motion_px: The mean length of the flow. A denser path lowers every error, so it belongs
            beside them.
        distances: As published, by name: of both pictures, black where `rmse` counts them as equal.
    """

    rmse: float
    covered_rmse: float
    covered_fraction: float
    motion_px: float
    distances: Mapping[str, float]


def splatting_errors(
    a: Image,
    b: Image,
    flow_between: FlowBetween,
    distances: Mapping[str, Distance] = NO_DISTANCES,
) -> SplattingErrors:
    """Returns how unlike frame b and frame a moved to it are.

    Args:
        a: In [0, 1].
        b: The same.
        flow_between: Estimates the flow from the first of two frames to the second.
        distances: Further measures of two pictures in [0, 1], by name.

    Raises:
        NotFiniteError: The flow is not finite.
    """
    flow = flow_between(a, b)
    require_finite("consistency", "between two frames", [("flow", flow)])
    moved, covered = splatted(a, flow, importance(a, b, flow))
    target = np.where(moved.any(axis=-1, keepdims=True), b, 0.0)
    pictures = moved.astype(np.float32), target.astype(np.float32)
    return SplattingErrors(
        rmse=_rms(moved - target),
        covered_rmse=_rms((moved - b)[covered]) if covered.any() else math.nan,
        covered_fraction=float(covered.mean()),
        motion_px=float(np.linalg.norm(flow, axis=-1).mean()),
        distances={name: distance(*pictures) for name, distance in distances.items()},
    )


def _rms(differences: np.ndarray) -> float:
    return float(np.sqrt(np.square(differences, dtype=np.float64).mean()))


def importance(a: Image, b: Image, flow: Flow) -> Float[np.ndarray, "height width"]:
    """Returns -10 |a(p) - b(p + flow(p))| in levels of 8 bits, channels averaged, at least -10.

    Of two pixels that are splatted to one place, the one that looks like it prevails: one level of
    difference is as bad as more. Outside frame b all is black.
    """
    height, width = flow.shape[:2]
    ends = torch.from_numpy(np.moveaxis(np.indices((height, width))[::-1], 0, -1) + flow)
    picture = torch.from_numpy(np.moveaxis(b, -1, 0).astype(np.float64))
    # A tenth of a level counts, so `sample_at` is too coarse.
    sampled = sample_tensor_at(picture[None], ends[None], "zeros")[0]
    warped = np.moveaxis(sampled.numpy(), 0, -1)
    levels = _LEVELS * np.abs(a - warped).mean(axis=-1, dtype=np.float64)
    return np.asarray(np.maximum(-_SHARPNESS * levels, -_MOST))


def splatted(
    image: Image, flow: Flow, importance: Float[np.ndarray, "height width"]
) -> tuple[Image, Bool[np.ndarray, "height width"]]:
    """Returns the image moved along the flow, and the pixels that something reaches.

    I'(q) = sum_p b(q - p - flow(p)) exp(z(p)) I(p) / sum_p b(q - p - flow(p)) exp(z(p)), with the
    bilinear kernel b and the importance z (Niklaus and Liu 2020, equation 9). Their code adds 1e-7
    to the second sum, which darkens pixels of little weight.

    Args:
        image: In [0, 1].
        flow: The displacement (x, y) in pixels.
        importance: z.
    """
    height, width = image.shape[:2]
    weight = np.exp(importance).reshape(-1)
    rows, columns = np.indices((height, width))
    x, y = (columns + flow[..., 0]).reshape(-1), (rows + flow[..., 1]).reshape(-1)
    left, top = np.floor(x), np.floor(y)
    total, colors = np.zeros(height * width), np.zeros((height * width, 3))
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, row = left + dx, top + dy
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        fraction = ((1 - np.abs(x - column)) * (1 - np.abs(y - row)) * weight)[inside]
        at = (row * width + column)[inside].astype(np.int64)
        total += np.bincount(at, fraction, height * width)
        for k in range(3):
            values = fraction * image.reshape(-1, 3)[inside, k]
            colors[:, k] += np.bincount(at, values, height * width)
    colors /= total[:, None] + _LEAST_SUM
    return colors.reshape(image.shape), (total > 0).reshape(height, width)


def of_levels(distance: Distance) -> Distance:
    """Returns LPIPS as the published code computes it: of values from 0 to 255.

    LPIPS is defined on [-1, 1].

    Args:
        distance: LPIPS of pictures in [0, 1], which are mapped to [-1, 1] first.
    """
    return lambda a, b: distance((_LEVELS * a + 1) / 2, (_LEVELS * b + 1) / 2)


def splatting_consistency(
    frames: Iterable[Image],
    flow_between: FlowBetween,
    distances: Mapping[str, Distance] = NO_DISTANCES,
) -> dict[str, dict[str, float]]:
    """Returns the mean errors and distances by gap, over the first 16 frames and over all of them.

    `gap_1` and `gap_7` of the first 16 frames are the published protocol's; `gap_1_whole` and
    `gap_7_whole` are over the whole path. Gaps that no two frames have are left out, and so are
    pairs without a covered pixel from the mean of `covered_rmse`.
    """
    images = list(frames)
    found: dict[str, dict[str, float]] = {}
    for gap in GAPS:
        errors = []
        for a, b in zip(images, images[gap:], strict=False):
            figures = asdict(splatting_errors(a, b, flow_between, distances))
            errors.append(figures | figures.pop("distances"))
        for name, some in (("", errors[: max(0, FIRST_FRAMES - gap)]), ("_whole", errors)):
            if some:
                means = {key: _mean([e[key] for e in some]) for key in some[0]}
                found[f"gap_{gap}{name}"] = means
    return found


def _mean(values: Sequence[float]) -> float:
    """Returns the mean of the values that are known; NaN if none is."""
    known = [value for value in values if not math.isnan(value)]
    return float(np.mean(known)) if known else math.nan
