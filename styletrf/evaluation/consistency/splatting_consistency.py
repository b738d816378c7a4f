"""The consistency protocol of papers since 2025: splat one frame along the flow to another.

Stylos (ICLR 2026) and AnyStyle (arXiv 2602.04043, appendix E) move stylized frame t along its own
flow to frame t + 1 or t + 7 by softmax splatting (Niklaus and Liu, CVPR 2020), and take the root of
the mean squared difference. It differs from the error of `flow_consistency` in all of this: the
flow is that of the stylized frames, which follows flicker; pixels that nothing is splatted to count
as errors of zero, so that more disocclusion lowers the figure.
"""

from collections.abc import Iterable
from dataclasses import asdict, dataclass

import numpy as np
from jaxtyping import Bool, Float

from styletrf.evaluation.flow import Flow, FlowEstimator, Image, warp_to_a
from styletrf.finiteness import require_finite

GAPS = 1, 7
FIRST_FRAMES = 16  # of the published figures
_SHARPNESS, _MOST = 10.0, 10.0  # of the published importance


@dataclass(frozen=True, slots=True)
class SplattingErrors:
    """Frame a, splatted to frame b, compared with it on [0, 1].

    Attributes:
        rmse: As published: over all pixels, those that nothing reaches counted as equal.
        covered_rmse: Over the pixels that something reaches; 0 where there are none.
        covered_fraction: Of the pixels, those that something reaches.
        motion_px: The mean length of the flow. A denser path lowers every error, so it belongs
            beside them.
    """

    rmse: float
    covered_rmse: float
    covered_fraction: float
    motion_px: float


def splatting_errors(a: Image, b: Image, estimator: FlowEstimator) -> SplattingErrors:
    """Returns how unlike frame b and frame a moved to it are.

    Raises:
        NotFiniteError: The flow is not.
    """
    flow = estimator(a, b)
    require_finite("consistency", f"by {estimator.method}", [("flow", flow)])
    moved, covered = splatted(a, flow, importance(a, b, flow))
    squared = np.where(covered[..., None], moved - b, 0.0).astype(np.float64) ** 2
    fraction = float(covered.mean())
    mean = float(squared.mean())
    seen = np.sqrt(mean / fraction) if fraction else 0.0
    motion = float(np.linalg.norm(flow, axis=-1).mean())
    return SplattingErrors(float(np.sqrt(mean)), float(seen), fraction, motion)


def importance(a: Image, b: Image, flow: Flow) -> Float[np.ndarray, "height width"]:
    """Returns -10 |a(p) - b(p + flow(p))|, mean over the channels, at least -10.

    Of two pixels that are splatted to one place, that prevails which looks like it.
    """
    warped, _ = warp_to_a(b, flow)
    return np.asarray(np.maximum(-_SHARPNESS * np.abs(a - warped).mean(axis=-1), -_MOST))


def splatted(
    image: Image, flow: Flow, importance: Float[np.ndarray, "height width"]
) -> tuple[Image, Bool[np.ndarray, "height width"]]:
    """Returns the image moved along the flow, and the pixels that something reaches.

    I'(q) = sum_p b(q - p - flow(p)) exp(z(p)) I(p) / sum_p b(q - p - flow(p)) exp(z(p)), with the
    bilinear kernel b and the importance z (Niklaus and Liu 2020, equation 9).

    Args:
        image: In [0, 1].
        flow: The displacement (x, y) in pixels.
        importance: z. What adds to all of it changes nothing.
    """
    height, width = image.shape[:2]
    weight = np.exp(importance - importance.max()).reshape(-1)
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
    covered = total > 0
    colors[covered] /= total[covered, None]
    return colors.reshape(image.shape), covered.reshape(height, width)


def splatting_consistency(
    frames: Iterable[Image], estimator: FlowEstimator
) -> dict[str, dict[str, float]]:
    """Returns the mean errors by gap, over the first 16 frames and over all of them.

    `gap_1` and `gap_7` of the first 16 frames are the published protocol's; `gap_1_whole` and
    `gap_7_whole` are over the whole path. Gaps that no two frames have are left out.
    """
    images = list(frames)
    found: dict[str, dict[str, float]] = {}
    for gap in GAPS:
        errors = [
            asdict(splatting_errors(a, b, estimator))
            for a, b in zip(images, images[gap:], strict=False)
        ]
        for name, some in (("", errors[: max(0, FIRST_FRAMES - gap)]), ("_whole", errors)):
            if some:
                means = {key: float(np.mean([e[key] for e in some])) for key in some[0]}
                found[f"gap_{gap}{name}"] = means
    return found
