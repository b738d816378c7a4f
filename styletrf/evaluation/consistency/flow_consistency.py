"""The paper's error of consistency: along the optical flow of the unstylized frames.

StyleTRF (Goel et al. 2022), section 6.2. A low error alone proves little: a gray video has none,
and the flow itself is imperfect. So the same error of the unstylized frames (the floor) and the
error where the flow can be trusted stand beside it.
"""

import math
from dataclasses import dataclass

import numpy as np

from styletrf.evaluation.flow import FlowEstimator, Mask, agreement, warp_to_a
from styletrf.evaluation.metrics import Image
from styletrf.finiteness import require_finite


@dataclass(frozen=True, slots=True)
class FlowErrors:
    """Two frames compared in the first one's view; errors are mean squares on [0, 1].

    Attributes:
        flow: The estimator of the flow.
        error: That of the stylized frames, over all pixels: the paper's figure.
        floor: The same of the unstylized frames.
        valid_fraction: The fraction of the pixels that return to themselves by way of the other
            frame.
        masked_error: `error` over the valid pixels; NaN where there are none.
        masked_floor: `floor` over the valid pixels; NaN where there are none.
    """

    flow: str
    error: float
    floor: float
    valid_fraction: float
    masked_error: float
    masked_floor: float


def flow_errors(
    unstylized: tuple[Image, Image], stylized: tuple[Image, Image], estimator: FlowEstimator
) -> FlowErrors:
    """Returns the errors of frames i and j along the flow w from unstylized i to unstylized j.

    The error is the mean over pixels p and channels of (S_i(p) - S_j(p + w(p)))^2. Pixels that
    leave the image take its nearest border pixel.

    Raises:
        NotFiniteError: The flow is not finite.
    """
    there, back = estimator(*unstylized), estimator(*unstylized[::-1])
    require_finite("consistency", f"by {estimator.method}", [("flow", there), ("flow back", back)])
    valid = agreement(there, back)
    painted, _ = warp_to_a(stylized[1], there)
    plain, _ = warp_to_a(unstylized[1], there)
    error, masked_error = _over_all_and(valid, painted, stylized[0])
    floor, masked_floor = _over_all_and(valid, plain, unstylized[0])
    fraction = float(valid.mean())
    return FlowErrors(estimator.method, error, floor, fraction, masked_error, masked_floor)


def _over_all_and(valid: Mask, a: Image, b: Image) -> tuple[float, float]:
    """Returns the mean squared error over all pixels, and over the valid ones."""
    squared = np.square(a.astype(np.float64) - b).mean(axis=-1)
    return float(squared.mean()), float(squared[valid].mean()) if valid.any() else math.nan
