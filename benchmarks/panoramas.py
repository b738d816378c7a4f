"""Poses of panoramas of the courtyard against where they were taken.

    panoramas.py make FOLDER [--count 12] [--width 2048]
    panoramas.py poses FOLDER [--untied]

`make` renders equirectangular panoramas along the walk of `styletrf.synthetic.courtyard` into
`FOLDER/images`; `FOLDER/poses.npy` holds world_from_panorama (count, 3, 4). `poses` cuts them,
solves the poses of the views and compares these with the true ones; untied, each view is a
photograph of its own for COLMAP.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
from tqdm import tqdm
from truth import agreement

from styletrf.capture.panorama.panorama_views import panorama_from_view
from styletrf.capture.scene_capture import capture_photographs
from styletrf.files.images import write_png
from styletrf.geometry.camera_table import read_cameras
from styletrf.geometry.cameras import Camera
from styletrf.sfm.camera_poses import CameraPosesConfig, solve_camera_poses
from styletrf.synthetic.courtyard import CourtyardConfig
from styletrf.synthetic.courtyard.panorama import render_panorama
from styletrf.synthetic.courtyard.paths import walk_poses


def make(folder: Path, count: int, width: int) -> None:
    """Renders the panoramas."""
    poses = walk_poses(count, np.random.default_rng([0, 30]))
    (folder / "images").mkdir(parents=True)
    np.save(folder / "poses.npy", poses)
    for index, pose in enumerate(tqdm(poses)):
        panorama = render_panorama(pose, width, CourtyardConfig(kind="walk"))
        write_png(folder / "images" / f"{index:03d}.png", panorama, compression=3)


def poses(folder: Path) -> None:
    """Solves the poses, and prints how far they are from the true ones."""
    with TemporaryDirectory() as scratch:
        work = Path(scratch)
        capture_photographs(folder / "images", work / "capture")
        config = CameraPosesConfig()
        report = solve_camera_poses(work / "capture", work / "poses", config, log_dir=work / "log")
        found = read_cameras(work / "poses" / "cameras.parquet")
    truth = [_true(camera, np.load(folder / "poses.npy")) for camera in found]
    said = {
        "registered": f"{report.registered} of {report.total}",
        "explained": report.matches_explained,
        "points": report.points,
        "verified_pairs": report.verified_pairs,
        "error_px": report.mean_reprojection_error_px,
        "mapper": f"{report.mapper}: {report.mapper_reason}",
    }
    print(json.dumps(said | agreement(found, truth), indent=1))  # noqa: T201


def _true(camera: Camera, poses: np.ndarray) -> Camera:
    name, direction = camera.name.rsplit("_", 1)
    rotation, center = poses[int(name), :, :3], poses[int(name), :, 3]
    pose = np.column_stack([rotation @ panorama_from_view(direction), center])
    return replace(camera, world_from_camera=pose)


def main() -> None:
    """Reads the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["make", "poses"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--width", type=int, default=2048)
    parser.add_argument("--untied", action="store_true")
    options = parser.parse_args()
    if options.what == "make":
        make(options.folder, options.count, options.width)
    elif options.untied:
        with patch("styletrf.sfm.colmap_features.write_rigs"):
            poses(options.folder)
    else:
        poses(options.folder)


if __name__ == "__main__":
    main()
