"""The box stands upright and looks as the photographers did, however they held the camera."""

import numpy as np
import pytest
from captures import GRAVITY, arc, nadir, points_of, room

from styletrf.scene.scene_model import SceneModelConfig, decide_scene_model


def vertical(model) -> np.ndarray:
    """The box's y axis, in the world."""
    return model.normalized_from_world[1, :3] / np.linalg.norm(model.normalized_from_world[1, :3])


@pytest.mark.parametrize("tilt", [0, 10, 25, 35, 60])
@pytest.mark.parametrize("extent", [90, 180, 360])
def test_a_box_stands_upright_whatever_the_tilt_and_the_arc(tilt, extent):
    """Around a ring that looks down the views' horizontal parts cancel: what is left is noise."""
    model = decide_scene_model(arc(tilt, extent), points_of("block"), SceneModelConfig(space="box"))
    assert vertical(model) @ GRAVITY > np.cos(np.radians(4))
    np.testing.assert_allclose(
        np.linalg.inv(model.normalized_from_world)[:3] @ [*model.focus, 1], 0, atol=0.15
    )


@pytest.mark.parametrize("yaw", ["same", "serpentine", "any"])
def test_views_straight_down_from_a_flat_grid_have_a_box(yaw):
    cameras = nadir(yaw)
    model = decide_scene_model(cameras, points_of("plain"), SceneModelConfig())
    assert model.space.kind == "box"
    assert model.looking == "ahead"
    assert np.isfinite(model.normalized_from_world).all()
    axes = model.normalized_from_world[:3, :3]
    np.testing.assert_allclose(axes[2] / np.linalg.norm(axes[2]), GRAVITY, atol=1e-6)


@pytest.mark.parametrize("tilt", [-15, 0, 20])
def test_photographs_that_look_out_of_a_circle_are_distinguished_from_those_that_look_in(tilt):
    out = decide_scene_model(room(tilt), points_of("room"), SceneModelConfig())
    assert (out.space.kind, out.looking) == ("box", "outward")
    assert out.evidence["looking"]["median_cosine_of_view_to_focus"] < -0.9
    inward = decide_scene_model(arc(tilt), points_of("block"), SceneModelConfig())
    assert (inward.space.kind, inward.looking) == ("box", "inward")


@pytest.mark.parametrize("cameras", [arc(25), room(0)], ids=["inward", "outward"])
def test_no_point_that_a_photograph_sees_is_nearer_than_the_box_begins(cameras):
    points = points_of("block" if cameras[0].center_world[1] < -1 else "room")
    model = decide_scene_model(cameras, points, SceneModelConfig(space="box"))
    scaled = points @ model.normalized_from_world[:3, :3].T + model.normalized_from_world[:3, 3]
    for view in model.normalized(cameras):
        camera_points = (scaled - view.center_world) @ view.world_from_camera[:, :3]
        depth = camera_points[:, 2]
        x, y = view.fx * camera_points[:, :2].T / depth
        seen = (depth > 0) & (abs(x) < view.cx) & (abs(y) < view.cy)
        assert (depth[seen] > model.space.depth_min).all()
        assert model.space.depth_min > 0.1 * depth[seen].min()  # and it is no hand-set trifle
