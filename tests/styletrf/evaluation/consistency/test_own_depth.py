"""Frames of a field whose density is its own are compared along its own depth as well."""

import math

import pytest
from moving_camera import DEPTH, FRAMES, STEP, WIDTH, pan, shown, texture

from styletrf.evaluation.consistency.trajectory_consistency import (
    Consistency,
    ConsistencyConfig,
    measure_consistency,
)
from styletrf.evaluation.perceptual_distance import PerceptualFeatures


@pytest.fixture
def measure(vgg):
    def measured(painted, own_depth=None) -> Consistency:
        frames = shown(pan(texture(0)), painted, own_depth=own_depth)
        look, config = PerceptualFeatures(vgg, 32), ConsistencyConfig(perceptual_px=32)
        return measure_consistency(frames, FRAMES, texture(1), look, config)

    return measured


def test_a_field_with_a_depth_of_its_own_is_steady_along_that_depth(measure):
    """A wall twice as far moves by half as many pixels."""
    painting = texture(1)
    half_as_fast = [painting[:, STEP * k // 2 : STEP * k // 2 + WIDTH] for k in range(FRAMES)]
    summary = measure(half_as_fast, own_depth=2 * DEPTH).summary
    assert summary
    for means in summary.values():
        assert means["own_error"] < 1e-9 < 1e-3 < means["geometric_error"]
        assert means["own_normalized_error"] < 1e-3
        assert means["own_fraction"] > means["geometric_fraction"]


def test_the_same_depth_gives_the_same_errors(measure):
    still = [pan(texture(1))[0]] * FRAMES
    summary = measure(still, own_depth=DEPTH).summary
    assert summary
    for means in summary.values():
        assert means["own_error"] == means["geometric_error"] > 1e-3
        assert means["own_fraction"] == means["geometric_fraction"]
        assert means["own_normalized_error"] == means["normalized_error"]


def test_pairs_that_share_nothing_by_their_own_depth_are_counted(measure):
    """A wall that is much nearer leaves the picture from one frame to the next."""
    summary = measure(pan(texture(1)), own_depth=DEPTH * STEP / (2 * WIDTH)).summary
    assert summary
    for means in summary.values():
        assert means["pairs_without_own_correspondence"] == means["pairs"] > 0
        assert means["pairs_without_correspondence"] == 0
        assert means["own_error"] is None


def test_frames_without_a_depth_of_their_own_have_no_such_errors(measure):
    found = measure(pan(texture(1)))
    assert found.pairs
    assert all(math.isnan(row["own_error"]) for row in found.pairs)
    assert not any("own_" in name for name in found.summary["delta_1"])
