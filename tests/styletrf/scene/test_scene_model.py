"""Decisions at the edges: thin evidence, odd scales, flat scenes."""

import re
from dataclasses import replace

import numpy as np
import pytest
from captures import forward_cameras, orbit_cameras, points_before, points_of, walk
from expected_errors import rejects

from styletrf.geometry.cameras import resized
from styletrf.scene.contraction import INNER
from styletrf.scene.exposure_choice import ExposureEvidence
from styletrf.scene.exposures import Exposure
from styletrf.scene.placement import transformed
from styletrf.scene.scene_model import (
    SceneModelConfig,
    decide_scene_model,
    read_scene_model,
    write_scene_model,
)


def test_too_few_points_are_an_error_that_says_what_to_do():
    with rejects("sparse points", 5):
        decide_scene_model(forward_cameras(), np.zeros((5, 3)), SceneModelConfig())


@pytest.mark.parametrize("long_side", [16, 20, 23])
def test_a_working_size_with_too_short_a_side_is_refused_and_the_remedy_works(long_side):
    """The field was fitted, and then the network ended in a traceback."""
    cameras = forward_cameras()
    with rejects(f"image_long_side {long_side}", "16") as caught:
        small = SceneModelConfig(image_long_side=long_side)
        decide_scene_model(cameras, points_before(cameras), small)
    (least,) = re.findall(r'"image_long_side": (\d+)', caught.value.remedy)
    config = SceneModelConfig(image_long_side=int(least))
    model = decide_scene_model(cameras, points_before(cameras), config)
    assert min(model.image_width, model.image_height) == 16


def test_photographs_too_small_to_paint_are_refused_whatever_the_working_size():
    cameras = [resized(camera, 30, 12) for camera in forward_cameras()]
    with rejects("image_long_side 504", "30x12", remedy=["photographs"]):
        decide_scene_model(cameras, points_before(cameras), SceneModelConfig())


@pytest.mark.parametrize("kind", ["ndc", "box", "unbounded"])
def test_a_space_that_is_set_is_that_of_the_scene_model(kind):
    cameras = forward_cameras() if kind == "ndc" else orbit_cameras()
    model = decide_scene_model(cameras, points_before(cameras), SceneModelConfig(space=kind))
    assert model.space.kind == kind
    assert model.evidence["space"]["by"] == "setting"


def test_a_space_is_chosen_by_the_voxels_that_each_may_have():
    cameras = orbit_cameras()

    def octaves_lost(**bounds):
        model = decide_scene_model(cameras, points_before(cameras), SceneModelConfig(**bounds))
        return model.evidence["space"]["octaves_lost"]

    few, many = octaves_lost(max_voxels=16**3), octaves_lost(max_voxels=32**3)
    assert many["box"] < few["box"]
    fewer_in_a_box = octaves_lost(max_voxels=32**3, max_box_voxels=16**3)
    assert fewer_in_a_box == {"box": few["box"], "unbounded": many["unbounded"]}


@pytest.mark.parametrize("kind", ["ndc", "box", "unbounded"])
def test_a_scene_model_does_not_depend_on_the_order_of_photographs(kind):
    """A small photograph made the lattice half as fine where its name came first."""
    first, *others = forward_cameras() if kind == "ndc" else orbit_cameras()
    points = points_before([first, *others])
    small = resized(first, first.width // 3, first.height // 3)
    config = SceneModelConfig(space=kind)
    before, after, large = (
        decide_scene_model(cameras, points, config)
        for cameras in ([small, *others], [*others, small], [first, *others])
    )
    assert before.resolution == after.resolution
    np.testing.assert_allclose(
        before.space.grid_from_world, after.space.grid_from_world, rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(before.resolution, large.resolution, rtol=0.05)


@pytest.mark.parametrize("space", ["box", "unbounded"])
@pytest.mark.parametrize("flat", [[1], [0, 2]])
def test_a_flat_scene_and_a_line_have_a_space_with_volume(space, flat):
    cameras = orbit_cameras()
    points = points_before(cameras)
    points[:, flat] = 0.5
    model = decide_scene_model(cameras, points, SceneModelConfig(space=space))
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


def test_a_mountain_behind_leaves_a_scene_of_a_meter_its_inner_box_and_is_in_the_grid():
    cameras, points = walk(), 3 * points_of("block")
    mountain = np.array([[0, -300.0, 2000.0], [50, -200, 2100], [-40, -250, 1900]])
    plain = decide_scene_model(cameras, points, SceneModelConfig(space="unbounded"))
    model = decide_scene_model(
        cameras, np.concatenate([points, mountain]), SceneModelConfig(space="unbounded")
    )
    np.testing.assert_allclose(
        model.normalized_from_world, plain.normalized_from_world, rtol=0.05, atol=0.05
    )
    far = transformed(model.normalized_from_world, mountain)
    assert (np.abs(model.space.to_grid(far)) <= 1).all()


@pytest.mark.parametrize(
    ("cameras", "points", "are_inside"),
    [
        (orbit_cameras(), points_of("block"), False),
        (walk(), 3 * points_of("block"), True),
    ],
)
def test_only_cameras_that_look_inward_stand_outside_the_inner_box(cameras, points, are_inside):
    model = decide_scene_model(cameras, points, SceneModelConfig(space="unbounded"))
    centers = np.stack([camera.center_world for camera in model.normalized(cameras)])
    assert (np.abs(model.space.to_grid(centers)).max(axis=1) <= INNER + 1e-9).all() == are_inside
    middle = np.abs(points - np.median(points, axis=0)) <= np.quantile(np.abs(points), 0.5, axis=0)
    inside = model.space.to_grid(transformed(model.normalized_from_world, points))
    assert (np.abs(inside[middle.all(axis=1)]) <= INNER).all()


@pytest.mark.parametrize("houses_m", [40.0, 400.0])
def test_houses_behind_a_subject_leave_it_its_voxels(houses_m):
    """Two thirds of the points of a statue in a square lay on houses, and its voxels were 23 cm."""
    cameras, points = orbit_cameras(), points_of("block")
    directions = np.random.default_rng(0).normal(size=(2 * len(points), 3)) * [1, 0.2, 1]
    houses = houses_m * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    config = SceneModelConfig(space="unbounded")
    plain, behind = (
        decide_scene_model(cameras, each, config)
        for each in (points, np.concatenate([points, houses]))
    )
    scales = [np.linalg.norm(each.normalized_from_world[0, :3]) for each in (plain, behind)]
    assert scales[1] >= 0.5 * scales[0]
    assert np.prod(behind.resolution) >= 0.8 * np.prod(plain.resolution)


def test_a_subject_without_points_is_in_the_inner_box():
    cameras = orbit_cameras()
    distance = np.linalg.norm(cameras[0].center_world)
    far = 10 * distance * points_of("block") / np.linalg.norm(points_of("block"), axis=1)[:, None]
    model = decide_scene_model(cameras, far, SceneModelConfig(space="unbounded"))
    subject = 0.2 * distance * np.array([[1.0, 1, 1], [-1, -1, -1], [1, -1, 1]])
    grid = model.space.to_grid(transformed(model.normalized_from_world, subject))
    assert (np.abs(grid) <= INNER).all()


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_a_walk_is_modeled_alike_at_any_scale(scale):
    plain, scaled = (
        decide_scene_model(
            [replace(c, world_from_camera=c.world_from_camera * [1, 1, 1, s]) for c in walk()],
            s * 3 * points_of("block"),
            SceneModelConfig(space="unbounded"),
        )
        for s in (1.0, scale)
    )
    assert scaled.resolution == plain.resolution
    np.testing.assert_allclose(scaled.space.grid_from_world, plain.space.grid_from_world, rtol=1e-6)


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


@pytest.mark.parametrize(
    ("setting", "spread", "chosen"),
    [("auto", 0.2, "each"), ("auto", 0.01, "one"), ("one", 0.2, "one"), ("each", 0.01, "each")],
)
def test_exposures_follow_the_evidence_or_the_setting_and_read_back(
    setting, spread, chosen, tmp_path
):
    cameras = forward_cameras()
    each = {camera.name: Exposure((0.1, 0.2, 0.3), (1.0, 1.1, 0.9)) for camera in cameras}
    model = decide_scene_model(
        cameras, points_before(cameras), SceneModelConfig(exposure=setting),
        exposure=ExposureEvidence(spread, 0.005, each),
    )  # fmt: skip
    assert model.evidence["exposure"]["chosen"] == chosen
    assert model.exposures == (each if chosen == "each" else {})
    write_scene_model(tmp_path / "scene.json", model)
    assert read_scene_model(tmp_path / "scene.json").exposures == model.exposures
