"""Real photographs against the poses that their data set publishes (LLFF's `poses_bounds.npy`)."""

import os
from pathlib import Path

import numpy as np
import pytest

from styletrf.capture.scene_capture import capture_photographs
from styletrf.geometry.camera_table import read_cameras
from styletrf.geometry.point_table import read_points
from styletrf.progress import silent
from styletrf.scene.scene_model import SceneModelConfig, decide_scene_model
from styletrf.sfm.camera_poses import CameraPosesConfig, solve_camera_poses

pytestmark = [pytest.mark.data, pytest.mark.slow]


@pytest.fixture(scope="module")
def scene() -> Path:
    """The smallest scene with published poses."""
    root = os.environ.get("STYLETRF_DATA")
    if not root:
        pytest.skip("STYLETRF_DATA names no folder of real photographs")
    scenes = [path.parent for path in Path(root).glob("scenes/*/poses_bounds.npy")]
    if not scenes:
        pytest.skip(f"no scene with poses_bounds.npy in {root}/scenes")
    return min(scenes, key=lambda folder: len(list((folder / "images").iterdir())))


@pytest.fixture(scope="module")
def solved(scene, tmp_path_factory):
    """The scene's photographs through COLMAP."""
    folder = tmp_path_factory.mktemp("real")
    (folder / "poses").mkdir()
    capture_photographs(scene / "images", folder / "capture")
    report = solve_camera_poses(
        folder / "capture", folder / "poses", CameraPosesConfig(), silent, folder / "log"
    )
    return folder / "poses", report


def published_poses(scene: Path) -> tuple[np.ndarray, np.ndarray]:
    """World-from-camera rotations (x right, y down, z forward) and centers, by sorted name."""
    table = np.load(scene / "poses_bounds.npy")[:, :15].reshape(-1, 3, 5)
    down, right, back = table[:, :, 0], table[:, :, 1], table[:, :, 2]
    return np.stack([right, down, -back], axis=2), table[:, :, 3]


def test_every_photograph_is_placed_where_the_data_set_says(scene, solved):
    folder, report = solved
    cameras = sorted(read_cameras(folder / "cameras.parquet"), key=lambda camera: camera.name)
    rotations, centers = published_poses(scene)
    assert len(cameras) == len(centers)
    assert report.mean_reprojection_error_px < 1
    ours = np.stack([camera.world_from_camera for camera in cameras])
    between = np.einsum("nij,nkj->nik", ours[:, :3, :3], rotations)  # one rotation for all
    u, _, vt = np.linalg.svd(between.sum(axis=0))
    aligned = np.einsum("ji,njk->nik", u @ vt, ours[:, :3, :3])
    cosines = (np.einsum("nij,nij->n", aligned, rotations) - 1) / 2
    assert np.degrees(np.arccos(np.clip(cosines, -1, 1))).max() < 0.5
    positions = (ours[:, :3, 3] - ours[:, :3, 3].mean(axis=0)) @ (u @ vt)
    target = centers - centers.mean(axis=0)
    scale = (positions * target).sum() / (positions**2).sum()
    residual = np.linalg.norm(scale * positions - target, axis=1)
    assert residual.max() < 0.03 * np.linalg.norm(target, axis=1).max()


def test_handheld_photographs_of_a_front_are_modeled_in_ndc(solved):
    folder, _ = solved
    model = decide_scene_model(
        read_cameras(folder / "cameras.parquet"),
        read_points(folder / "points.parquet").xyz_world,
        SceneModelConfig(),
    )
    assert model.space.kind == "ndc"
