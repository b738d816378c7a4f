"""A plane sweep finds the depth of what has texture, and says where it has found none."""

from dataclasses import replace

import numpy as np
import pytest
from textured_scenes import textured_cameras, wall_depth, wall_view

from styletrf.scene.stereo.plane_sweep import swept_depth
from styletrf.scene.stereo.stereo_depths import LEAST_SCORE, TOLERANCE


def test_depths_of_a_textured_wall_are_those_of_its_plane():
    """But for a margin of 8 pixels, which few neighbors see."""
    view, *others = map(wall_view, textured_cameras())
    swept, middle = swept_depth(view, others, 2.0, 8.0), np.s_[8:-8, 8:-8]
    is_confident = swept.score[middle] > LEAST_SCORE
    assert is_confident.mean() > 0.9
    errors = np.abs(swept.depth / wall_depth(view.camera) - 1)[middle]
    assert np.quantile(errors[is_confident], 0.95) < 0.02


@pytest.mark.parametrize(("gain", "power"), [(0.6, 1.0), (1.0, 1.6)])
def test_exposure_of_neighbors_changes_no_depth(gain, power):
    view, *others = map(wall_view, textured_cameras())
    changed = [replace(other, gray=gain * other.gray ** np.float32(power)) for other in others]
    plain, exposed = (swept_depth(view, each, 2.0, 8.0) for each in (others, changed))
    is_confident = np.minimum(plain.score, exposed.score) > LEAST_SCORE
    assert is_confident.mean() > 0.5
    assert np.quantile(np.abs(exposed.depth / plain.depth - 1)[is_confident], 0.9) < TOLERANCE


def test_walls_without_texture_have_no_confident_depth():
    view, *others = (wall_view(camera, contrast=0.002) for camera in textured_cameras())
    assert swept_depth(view, others, 2.0, 8.0).score.max() < LEAST_SCORE


def test_pixels_that_do_not_count_in_a_neighbor_give_no_score():
    view, other, *_ = map(wall_view, textured_cameras())
    masked = replace(other, counts=np.zeros_like(other.counts))
    assert swept_depth(view, [masked], 2.0, 8.0).score.max() == -1


def test_depths_out_of_range_have_no_confident_depth():
    view, *others = map(wall_view, textured_cameras())
    swept = swept_depth(view, others, 10.0, 20.0)
    assert (swept.score > LEAST_SCORE).mean() < 0.1
