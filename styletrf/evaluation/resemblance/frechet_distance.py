"""The Fréchet distance between Gaussians that are fitted to the features of two pictures."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor


@dataclass(frozen=True, slots=True)
class FeatureStatistics:
    """The mean of a picture's features over its places, and the root of their covariance."""

    mean: Float[np.ndarray, " channels"]
    root: Float[np.ndarray, "channels channels"]


@torch.inference_mode()
def feature_statistics(features: Float[Tensor, "channels places"]) -> FeatureStatistics:
    """Returns the statistics, computed in float64."""
    values = features.cpu().double().numpy()
    mean = values.mean(axis=1)
    centered = values - mean[:, None]
    levels, axes = np.linalg.eigh(centered @ centered.T / values.shape[1])
    return FeatureStatistics(mean, (axes * np.sqrt(levels.clip(min=0))) @ axes.T)


def frechet_distance(a: FeatureStatistics, b: FeatureStatistics) -> float:
    """Returns the squared Fréchet distance of two Gaussians (Dowson and Landau 1982, equation 4).

        |m_a - m_b|^2 + tr(S_a + S_b - 2 (S_a S_b)^1/2)

    of means m and covariances S; the last trace is the sum of the singular values of
    S_a^1/2 S_b^1/2. It is 0 for equal statistics and never negative.
    """
    apart = np.square(a.mean - b.mean).sum()
    spread = np.square(a.root).sum() + np.square(b.root).sum()
    shared = np.linalg.svd(a.root @ b.root, compute_uv=False).sum()
    return float(max(0.0, apart + spread - 2 * shared))
