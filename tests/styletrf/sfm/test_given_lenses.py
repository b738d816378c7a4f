"""Lenses that come with photographs in landscape and in portrait format."""

import json

import numpy as np
import pycolmap
import pytest
from given_cameras import FOCAL, HEIGHT, VIEWS, WIDTH, photographed
from made_photographs import room_poses

from styletrf.capture.poses.pose_formats import find_given_poses
from styletrf.capture.scene_capture import capture_photographs
from styletrf.geometry.camera_table import read_cameras
from styletrf.sfm.camera_poses import CameraPosesConfig, solve_camera_poses

SIZES = [(HEIGHT, WIDTH), (WIDTH, HEIGHT)] * 2
"""Portrait and landscape by turns; the first stands."""


def photographed_by_turns(folder, poses):
    for index, (pose, (width, height)) in enumerate(zip(poses, SIZES, strict=True)):
        params = [FOCAL, FOCAL, width / 2, height / 2]
        lens = pycolmap.Camera(model="PINHOLE", width=width, height=height, params=params)
        photographed(folder, lens, [pose], [f"images/{index}.png"])


def write_transforms(folder, poses, of_all, of_frame=lambda _: {}):
    frames = [
        {
            "file_path": f"images/{index}.png",
            "transform_matrix": (
                np.vstack([pose, [0, 0, 0, 1]]) @ np.diag([1, -1, -1, 1])
            ).tolist(),
            **of_frame(size),
        }
        for index, (pose, size) in enumerate(zip(poses, SIZES, strict=True))
    ]
    (folder / "transforms.json").write_text(json.dumps({**of_all, "frames": frames}))


def transforms_without_sizes(folder, poses):
    write_transforms(folder, poses, {"fl_x": FOCAL})


def transforms_with_the_angle_of_the_first(folder, poses):
    write_transforms(folder, poses, {"camera_angle_x": 2 * np.arctan(0.5 * SIZES[0][0] / FOCAL)})


def transforms_with_angles(folder, poses):
    def angle(size):
        return {"camera_angle_x": 2 * np.arctan(0.5 * size[0] / FOCAL)}

    write_transforms(folder, poses, {}, angle)


def transforms_with_one_size(folder, poses):
    lens = {
        "w": WIDTH,
        "h": HEIGHT,
        "fl_x": FOCAL,
        "fl_y": FOCAL,
        "cx": WIDTH / 2,
        "cy": HEIGHT / 2,
    }
    write_transforms(folder, poses, lens)


def llff(folder, poses, sizes=SIZES):
    rows = []
    for pose, (width, height) in zip(poses, sizes, strict=True):
        right, down, ahead, center = pose.T
        matrix = np.column_stack([down, right, -ahead, center, [height, width, FOCAL]])
        rows.append(np.concatenate([matrix.reshape(-1), [1.0, 10.0]]))
    np.save(folder / "poses_bounds.npy", np.array(rows))


def llff_with_one_size(folder, poses):
    llff(folder, poses, [(WIDTH, HEIGHT)] * len(poses))


@pytest.mark.parametrize(
    "write",
    [
        transforms_without_sizes,
        transforms_with_the_angle_of_the_first,
        transforms_with_angles,
        transforms_with_one_size,
        llff,
        llff_with_one_size,
    ],
)
def test_photographs_that_lie_and_stand_have_the_lenses_that_are_given(write, tmp_path):
    """All had the size of the first, and COLMAP left out those of another."""
    poses = room_poses(VIEWS)[: len(SIZES)]
    photographed_by_turns(tmp_path, poses)
    write(tmp_path, poses)
    given = find_given_poses(tmp_path)
    capture_photographs(tmp_path / "images", tmp_path / "capture", given=given)
    (tmp_path / "out").mkdir()
    config = CameraPosesConfig(poses="given", max_features=512)
    report = solve_camera_poses(
        tmp_path / "capture", tmp_path / "out", config, log_dir=tmp_path / "log"
    )
    assert report.mean_reprojection_error_px < 0.5
    assert report.doubts == (), "few exact poses, whose matches are mostly of two photographs"
    cameras = read_cameras(tmp_path / "out" / "cameras.parquet")
    assert [(camera.width, camera.height) for camera in cameras] == SIZES
    for camera in cameras:
        assert (camera.fx, camera.fy) == pytest.approx((FOCAL, FOCAL))
        assert (camera.cx, camera.cy) == (camera.width / 2, camera.height / 2)
