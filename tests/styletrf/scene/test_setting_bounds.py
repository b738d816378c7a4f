"""Settings that cannot work are refused before anything is computed."""

import pytest
from expected_errors import rejects

from styletrf.capture.scene_capture import CaptureConfig
from styletrf.configuration import configured
from styletrf.scene.scene_model import SceneModelConfig
from styletrf.sfm.camera_poses import CameraPosesConfig
from styletrf.trajectory.coverage import CoverageConfig


@pytest.mark.parametrize(
    ("config", "name", "value"),
    [
        (CaptureConfig, "video_frames", -5),
        (CaptureConfig, "video_frames", 2),
        (CameraPosesConfig, "camera_model", "FOO"),
        (CameraPosesConfig, "camera_model", "INVALID"),
        (CameraPosesConfig, "max_image_long_side", 0),
        (CameraPosesConfig, "max_features", 0),
        (CameraPosesConfig, "video_features", -1),
        (CameraPosesConfig, "tracks", 0),
        (CameraPosesConfig, "neighbors", 0),
        (CameraPosesConfig, "video_neighbors", 0),
        (CameraPosesConfig, "exhaustive_up_to", -1),
        (CameraPosesConfig, "preemptive_up_to", -1),
        (SceneModelConfig, "image_long_side", 0),
        (SceneModelConfig, "image_long_side", 15),
        (SceneModelConfig, "max_voxels", 0),
        (SceneModelConfig, "max_box_voxels", -1),
        (SceneModelConfig, "oversampling", 0.0),
        (CoverageConfig, "depth_px", -1),
        (CoverageConfig, "depth_px", 15),
        (CoverageConfig, "tolerance", -0.5),
    ],
)
def test_a_setting_that_cannot_work_is_refused(config, name, value):
    with rejects(repr(name), name, str(value).removesuffix(".0")):
        configured(config, {name: value})


@pytest.mark.parametrize("model", ["SIMPLE_PINHOLE", "OPENCV", "OPENCV_FISHEYE", "FULL_OPENCV"])
def test_lens_models_of_colmap_are_settings(model):
    assert configured(CameraPosesConfig, {"camera_model": model}).camera_model == model
