"""The Fréchet distance: the closed form of commuting covariances, zero for itself, extremes."""

import math

import numpy as np
import pytest
import torch

from styletrf.evaluation.resemblance.frechet_distance import (
    FeatureStatistics,
    feature_statistics,
    frechet_distance,
)


def features(seed: int, channels: int = 8, places: int = 500) -> torch.Tensor:
    return torch.randn(channels, places, generator=torch.Generator().manual_seed(seed))


def test_of_covariances_that_commute_it_is_a_difference_of_deviations():
    a = FeatureStatistics(np.array([1.0, 2.0]), np.diag([3.0, 1.0]))
    b = FeatureStatistics(np.array([1.0, 4.0]), np.diag([1.0, 2.0]))
    assert frechet_distance(a, b) == pytest.approx(4 + 4 + 1)
    assert frechet_distance(a, b) == pytest.approx(frechet_distance(b, a))


def test_the_root_squared_is_the_covariance():
    found = feature_statistics(features(0))
    covariance = np.cov(features(0).double().numpy(), bias=True)
    np.testing.assert_allclose(found.root @ found.root, covariance, atol=1e-12)


def test_the_frechet_distance_to_itself_is_zero_in_any_order_of_places():
    shuffled = features(0)[:, torch.randperm(500, generator=torch.Generator().manual_seed(1))]
    a, b = feature_statistics(features(0)), feature_statistics(shuffled)
    assert frechet_distance(a, b) == pytest.approx(0, abs=1e-9)
    assert frechet_distance(a, feature_statistics(features(2))) > 0


@pytest.mark.parametrize("other", [torch.zeros(8, 500), 1e6 * features(1), features(1, 8, 1)],
                         ids=["nothing", "huge", "one place"])  # fmt: skip
def test_the_distance_to_extreme_features_is_finite_and_above_zero(other):
    found = frechet_distance(feature_statistics(features(0)), feature_statistics(other))
    assert math.isfinite(found)
    assert found > 0
