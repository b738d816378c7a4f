"""Scenes of the room with their exact poses, in every format."""

import json

import numpy as np
import pycolmap
from given_cameras import BENT, FOCAL, HEIGHT, WIDTH, colmap, photographed
from made_photographs import room_poses

PINHOLE = pycolmap.Camera(
    model="PINHOLE", width=WIDTH, height=HEIGHT, params=[FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2]
)


def square(pose):
    return np.vstack([pose, [0, 0, 0, 1]])


def as_opengl(pose):
    return (square(pose) @ np.diag([1.0, -1, -1, 1])).tolist()


def blender(folder, poses):
    """Train and test apart, and photographs of one name in two folders; names have no suffix.

    The photographs' natural order begins with the second file.
    """
    half = len(poses) // 2
    for part, chosen in (("test", poses[:half]), ("train", poses[half:])):
        names = [f"{part}/r_{index}" for index in range(half)]
        photographed(folder, PINHOLE, chosen, [f"{name}.png" for name in names])
        frames = [
            {"file_path": f"./{name}", "transform_matrix": as_opengl(pose)}
            for name, pose in zip(names, chosen, strict=True)
        ]
        content = {"camera_angle_x": 2 * np.arctan(0.5 * WIDTH / FOCAL), "frames": frames}
        (folder / f"transforms_{part}.json").write_text(json.dumps(content))


def instant_ngp(folder, poses):
    """A lens that bends; one photograph is named that is not there, and one there has no pose."""
    photographed(folder, BENT, poses)
    names = ["fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2"]
    content = dict(zip(names, BENT.params.tolist(), strict=True)) | {"w": WIDTH, "h": HEIGHT}
    content["frames"] = [
        {"file_path": f"images/{index}.png", "transform_matrix": as_opengl(pose)}
        for index, pose in enumerate([*poses, poses[0]])
    ]
    (folder / "transforms.json").write_text(json.dumps(content))
    (folder / "images" / "extra.png").write_bytes((folder / "images" / "0.png").read_bytes())


FISHEYE = pycolmap.Camera(
    model="OPENCV_FISHEYE",
    width=WIDTH,
    height=HEIGHT,
    params=[150.0, 150.0, WIDTH / 2, HEIGHT / 2, 0.02, -0.01, 0.003, -0.001],
)


def nerfstudio_fisheye(folder, poses):
    """It was read as a lens of OpenCV's usual model, so that every pose looked wrong."""
    photographed(folder, FISHEYE, poses)
    names = ["fl_x", "fl_y", "cx", "cy", "k1", "k2", "k3", "k4"]
    content = dict(zip(names, FISHEYE.params.tolist(), strict=True)) | {"w": WIDTH, "h": HEIGHT}
    content["camera_model"] = "OPENCV_FISHEYE"
    content["frames"] = [
        {"file_path": f"images/{index}.png", "transform_matrix": as_opengl(pose)}
        for index, pose in enumerate(poses)
    ]
    (folder / "transforms.json").write_text(json.dumps(content))


FULL = pycolmap.Camera(
    model="FULL_OPENCV",
    width=WIDTH,
    height=HEIGHT,
    params=[FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2, 0.05, -0.02, 0.001, -0.001, 0.15, 0, 0, 0],
)


def third_coefficient(folder, poses):
    photographed(folder, FULL, poses)
    names = ["fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2", "k3"]
    content = dict(zip(names, FULL.params.tolist(), strict=False)) | {"w": WIDTH, "h": HEIGHT}
    content["frames"] = [
        {"file_path": f"images/{index}.png", "transform_matrix": as_opengl(pose)}
        for index, pose in enumerate(poses)
    ]
    (folder / "transforms.json").write_text(json.dumps(content))


def llff(folder, poses):
    photographed(folder, PINHOLE, poses)
    rows = []
    for pose in poses:
        right, down, ahead, center = pose.T
        matrix = np.column_stack([down, right, -ahead, center, [2 * HEIGHT, 2 * WIDTH, 2 * FOCAL]])
        rows.append(np.concatenate([matrix.reshape(-1), [1.0, 10.0]]))
    np.save(folder / "poses_bounds.npy", np.array(rows))


def colmap_text(folder, poses):
    colmap(folder, poses, text=True)


def ngp_with(folder, **changes):
    instant_ngp(folder, room_poses(3))
    content = json.loads((folder / "transforms.json").read_text())
    content["frames"][1] |= changes.pop("frame", {})
    (folder / "transforms.json").write_text(json.dumps(content | changes))
    return folder
