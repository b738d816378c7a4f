"""LLFF's table of poses: its axes, its pixels, its bounds."""

from pathlib import Path

import numpy as np
import pytest
from expected_errors import rejects

from styletrf.capture.poses.llff_poses import read_llff_poses
from styletrf.geometry.cameras import project


def row(down, right, back, center, height=40.0, width=60.0, focal=50.0, near=2.0, far=8.0):
    matrix = np.column_stack([down, right, back, center, [height, width, focal]])
    return np.concatenate([matrix.reshape(-1), [near, far]])


LEVEL = row([0, -1, 0], [1, 0, 0], [0, 0, 1], [1, 2, 3])  # y up, looking along -z


def written(tmp_path: Path, rows) -> Path:
    np.save(tmp_path / "poses_bounds.npy", np.array(rows, dtype=np.float64))
    return tmp_path / "poses_bounds.npy"


def test_a_point_is_seen_where_the_axes_say(tmp_path):
    (camera,) = read_llff_poses(written(tmp_path, [LEVEL]), ["a"])
    ahead = np.array([1.0, 2.0, 3.0 - 5.0])
    pixels, depth = project(camera, ahead + np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]))
    np.testing.assert_allclose(pixels, [[30, 20], [40, 20], [30, 10]])
    np.testing.assert_allclose(depth, 5)


def test_each_row_has_its_own_size_and_focal_length(tmp_path):
    standing = LEVEL.copy()
    standing[[4, 9, 14]] = 60, 40, 55
    lying, upright = read_llff_poses(written(tmp_path, [LEVEL, standing]), ["a", "b"])
    assert (lying.width, lying.height, lying.fx, lying.fy) == (60, 40, 50, 50)
    assert (upright.width, upright.height, upright.fx, upright.fy) == (40, 60, 55, 55)
    assert (upright.cx, upright.cy) == (20, 30)


@pytest.mark.parametrize("rows", [[LEVEL, LEVEL], [LEVEL[:16]], [LEVEL * np.nan]])
def test_a_table_of_something_else_is_refused(tmp_path, rows):
    with rejects(tmp_path / "poses_bounds.npy", 17):
        read_llff_poses(written(tmp_path, rows), ["a"])


@pytest.mark.parametrize("number", [4, 9, 14])
def test_a_lens_of_no_size_is_refused(tmp_path, number):
    """It ended in a division by zero."""
    flat = LEVEL.copy()
    flat[number] = 0
    with rejects(tmp_path / "poses_bounds.npy", "focal"):
        read_llff_poses(written(tmp_path, [flat]), ["a"])


def test_a_file_that_is_no_table_is_refused(tmp_path):
    (tmp_path / "poses_bounds.npy").write_bytes(b"no table")
    with rejects(tmp_path / "poses_bounds.npy", "table"):
        read_llff_poses(tmp_path / "poses_bounds.npy", ["a"])
