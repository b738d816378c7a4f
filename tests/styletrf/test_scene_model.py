"""Decisions at the edges: thin evidence, odd scales, flat scenes."""

import numpy as np
import pytest
from test_space import forward_cameras, orbit_cameras, points_before

from styletrf.errors import InputError
from styletrf.scene_model import SceneModelConfig, decide_scene_model


def test_too_few_points_are_an_error_that_says_what_to_do():
    with pytest.raises(InputError, match="Take more overlapping photographs"):
        decide_scene_model(forward_cameras(), np.zeros((5, 3)), SceneModelConfig())


@pytest.mark.parametrize("kind", ["ndc", "box"])
def test_the_space_can_be_set(kind):
    cameras = orbit_cameras() if kind == "box" else forward_cameras()
    model = decide_scene_model(cameras, points_before(cameras), SceneModelConfig(space=kind))
    assert model.space.kind == kind
    assert model.evidence["space"]["by"] == "setting"


def test_a_flat_scene_has_a_box_with_volume():
    cameras = orbit_cameras()
    points = points_before(cameras)
    points[:, 1] = 0.5
    model = decide_scene_model(cameras, points, SceneModelConfig(space="box"))
    assert min(model.space.axis_lengths) > 0
    assert min(model.resolution) >= 16
    assert np.isfinite(model.space.grid_from_world).all()


def test_a_mountain_behind_the_scene_does_not_move_the_near_plane():
    cameras = forward_cameras()
    points = points_before(cameras)
    plain = decide_scene_model(cameras, points, SceneModelConfig())
    far = np.concatenate([points, [[3000.0, 0, 10000.0]]])
    model = decide_scene_model(cameras, far, SceneModelConfig())
    np.testing.assert_allclose(
        model.space.grid_from_world, plain.space.grid_from_world, rtol=0.05, atol=0.05
    )


def test_points_behind_the_cameras_are_not_near_points():
    cameras = forward_cameras()
    points = np.concatenate([points_before(cameras), [[0, 0, -5.0]]])
    model = decide_scene_model(cameras, points, SceneModelConfig(space="ndc"))
    assert np.isfinite(model.space.grid_from_world).all()
    assert model.focus[2] > 0


def test_the_resolution_keeps_under_its_bound():
    cameras = forward_cameras()
    for bound in (20**3, 64**3, 128**3):
        model = decide_scene_model(
            cameras, points_before(cameras), SceneModelConfig(max_voxels=bound)
        )
        assert np.prod(model.resolution) < 1.1 * bound  # each axis is rounded
