"""The distance to what is occupied, and marching over what is not: quicker, and the same."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from kernel_cases import make_segments

from styletrf.kernels import March, kernels_for
from styletrf.kernels.clearance_numba import FARTHEST, clearance
from styletrf.tensor_vm import TensorVM


@pytest.mark.parametrize("shape", [(7, 5, 9), (1, 1, 12), (1, 8, 1), (3, 3, 3), (1, 1, 1)])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 1.0])
def test_it_is_chebyshevs_distance(shape, share):
    occupied = np.random.default_rng(0).random(shape) < share
    found, places = clearance(occupied), np.argwhere(occupied)
    for voxel in np.ndindex(shape):
        distances = np.abs(places - voxel).max(axis=1)
        distance = min(distances.min(initial=FARTHEST), FARTHEST)
        assert found[voxel] == {0: 1, 1: 0}.get(distance, distance)


def test_what_lies_far_off_is_called_no_farther_than_64():
    occupied = np.zeros((1, 1, 300), dtype=bool)
    occupied[0, 0, 0] = True
    assert clearance(occupied).max() == FARTHEST


@pytest.mark.parametrize("share", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("reach", [0.9, 1.5, 1e6, float("nan")])
@pytest.mark.parametrize("max_steps", [3, 40, 900])
def test_passing_over_what_is_empty_changes_no_sample(share, reach, max_steps):
    g = torch.Generator().manual_seed(3)
    occupied = torch.rand(23, 17, 31, generator=g) < share
    occupied[:2, :2, :2] = False  # where coordinates that are NaN count as lying
    factors = TensorVM((9, 8, 7), (2, 1, 1), generator=g)
    segments = make_segments(200, seed=4, max_steps=max_steps)
    segments = replace(
        segments, origins=segments.origins * reach, directions=segments.directions * reach
    )
    jitter = torch.rand(200, generator=g)
    by_voxel = March(occupied.to(torch.uint8), 0.0, 1.0, 1e-3)
    by_distance = replace(by_voxel, occupancy=torch.from_numpy(clearance(occupied.numpy())))
    fused = kernels_for(torch.device("cpu"), "fused")
    a, b = (fused.trace(factors, segments, jitter, march) for march in (by_voxel, by_distance))
    assert torch.equal(a.offsets, b.offsets)
    assert torch.equal(a.s, b.s)
    assert torch.equal(a.weights, b.weights)
    assert len(a.ray) or reach != 0.9
