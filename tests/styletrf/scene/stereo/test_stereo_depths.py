"""Depths are kept where photographs agree."""

import numpy as np
import pytest
from textured_scenes import textured_cameras, wall_depth, wall_picture, wall_points

from styletrf.scene.scene_model import SceneModel, SceneModelConfig, decide_scene_model
from styletrf.scene.stereo.stereo_depths import StereoDepth, stereo_depths


@pytest.fixture(scope="module")
def model() -> SceneModel:
    cameras = textured_cameras()
    config = SceneModelConfig(space="box")
    return decide_scene_model(cameras, wall_points(cameras).xyz_world, config)


def depths_of(model, images, masks=(None,) * 5, points=None) -> list[StereoDepth]:
    cameras = textured_cameras()
    return stereo_depths(model, cameras, points or wall_points(cameras), images, masks)


def test_depths_of_a_wall_are_known_nearly_everywhere_in_the_normalized_world(model):
    cameras = textured_cameras()
    scale = float(np.cbrt(np.linalg.det(model.normalized_from_world[:3, :3])))
    found = depths_of(model, map(wall_picture, cameras))
    for camera, of_view in zip(cameras, found, strict=True):
        known = np.isfinite(of_view.depth)
        assert known.mean() > 0.5
        errors = of_view.depth[known] / (scale * wall_depth(camera)[known]) - 1
        assert np.quantile(np.abs(errors), 0.95) < 0.03


def test_a_photograph_of_another_place_has_no_depths(model):
    pictures = [
        wall_picture(camera, seed=int(k == 2)) for k, camera in enumerate(textured_cameras())
    ]
    fractions = [np.isfinite(found.depth).mean() for found in depths_of(model, pictures)]
    assert fractions[2] < 0.02
    assert min(fractions[:2] + fractions[3:]) > 0.3


def test_masked_pixels_have_no_depths(model):
    cameras = textured_cameras()
    masks = [np.ones((64, 96), bool) for _ in cameras]
    masks[0][:, :48] = False
    found = depths_of(model, map(wall_picture, cameras), masks)[0]
    assert not np.isfinite(found.depth[:, :48]).any()
    assert np.isfinite(found.depth[:, 48:]).mean() > 0.3


def test_without_points_there_are_no_depths(model):
    cameras = textured_cameras()
    none = wall_points(cameras).of_images([])
    found = depths_of(model, map(wall_picture, cameras), points=none)
    assert len(found) == len(cameras)
    for of_view in found:
        assert not np.isfinite(of_view.depth).any()
