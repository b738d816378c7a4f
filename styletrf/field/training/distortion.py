"""The distortion of a ray: how far its weights lie apart (Barron et al. 2022, eq. 15).

    sum_ij w_i w_j |s_i - s_j| + 1/3 sum_i w_i^2 step

The distortion falls when the weights of a ray gather at one place: fog and doubled surfaces raise
it.
"""

from jaxtyping import Float
from torch import Tensor

from styletrf.field.kernels import RaySegments, Samples


def distortion(samples: Samples, segments: RaySegments) -> Float[Tensor, ""]:
    """Returns the mean distortion of the rays, in segment lengths, differentiable in the weights.

    The time is linear in the number of samples: with s ascending along a ray, the double sum is
    2 sum_i w_i (s_i W_i - S_i), W_i and S_i the sums of w and w s before sample i.
    """
    weights, s = samples.weights.double(), samples.s.double()
    before, moment_before = samples.sums_before(weights), samples.sums_before(weights * s)
    between = 2 * (weights * (s * before - moment_before)).sum()
    step = 1 / segments.n_steps.clamp(min=1)[samples.ray]
    within = (weights.square() * step).sum() / 3
    return ((between + within) / max(len(segments), 1)).float()
