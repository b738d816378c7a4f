"""NDC holds what it is chosen for: every corner of every view, from the near points on."""

import numpy as np
import pytest
from captures import arc, forward_cameras, points_before, points_of
from expected_errors import rejects

from styletrf.configuration import configured
from styletrf.scene.scene_model import SceneModelConfig, decide_scene_model


@pytest.mark.parametrize(
    ("tilt", "extent", "has_frustum"),
    [(0, 90, True), (0, 80, True), (45, 360, True), (60, 360, True),
     (25, 120, False), (0, 180, False)],
)  # fmt: skip
def test_a_capture_whose_views_fan_out_is_none_for_a_frustum(tilt, extent, has_frustum):
    """It would be several views wide, or there is none, as corners of views look sideways."""
    model = decide_scene_model(arc(tilt, extent), points_of("block"), SceneModelConfig())
    evidence = model.evidence["space"]
    assert evidence["chosen"] == model.space.kind == "box"
    assert (evidence["least_corner_depth"] > evidence["corner_depth_threshold"]) == has_frustum
    if has_frustum:
        assert evidence["stretch"] > evidence["stretch_threshold"]
    else:
        assert evidence["stretch"] is None


def test_a_short_arc_is_forward_facing():
    model = decide_scene_model(arc(0, 25), points_of("block"), SceneModelConfig())
    assert model.space.kind == "ndc"
    assert 1 < model.evidence["space"]["stretch"] < 2.5


def test_the_frustum_holds_every_corner_from_the_near_points_to_infinity():
    cameras = forward_cameras()
    model = decide_scene_model(cameras, points_before(cameras), SceneModelConfig())
    largest = 0.0
    for view in model.normalized(cameras):
        for x in (0, view.width):
            for y in (0, view.height):
                ray = np.array([(x - view.cx) / view.fx, (y - view.cy) / view.fy, 1.0])
                direction = view.world_from_camera[:, :3] @ ray
                for z in (1.0, 3.0, model.evidence["near_far"]["infinity_normalized"]):
                    point = (
                        view.center_world + (z - view.center_world[2]) / direction[2] * direction
                    )
                    largest = max(largest, np.abs(model.space.to_grid(point[None])).max())
    assert 0.99 < largest < 1 + 1e-9


def test_beyond_infinity_nothing_moves_by_a_pixel_and_all_points_are_before_it():
    cameras = forward_cameras()
    points = points_before(cameras)
    model = decide_scene_model(cameras, points, SceneModelConfig())
    views, far = model.normalized(cameras), model.evidence["near_far"]["infinity_normalized"]
    centers = np.stack([view.center_world for view in views])
    assert views[0].fx * np.ptp(centers, axis=0)[:2].max() / far <= 0.25 + 1e-9
    scaled = points @ model.normalized_from_world[:3, :3].T + model.normalized_from_world[:3, 3]
    assert scaled[:, 2].max() * 5 < far


@pytest.mark.parametrize("cameras", [arc(10), arc(0, 180)], ids=["ring", "half"])
def test_a_frustum_that_cannot_be_is_refused_when_it_is_asked_for(cameras):
    with rejects("space 'ndc'"):
        decide_scene_model(cameras, points_of("block"), SceneModelConfig(space="ndc"))


@pytest.mark.parametrize("word", ["contracted", "NDC", ""])
def test_a_space_that_is_none_is_refused_with_those_that_are(word):
    with rejects("setting 'space'", repr(word), remedy=["auto", "ndc", "box"]):
        configured(SceneModelConfig, {"space": word})
