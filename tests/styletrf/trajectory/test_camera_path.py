"""Frames along named paths and along files: length, shape, speed, and where they are."""

import json
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from expected_errors import rejects
from mini_scene import painted_plane
from trajectory_captures import CAPTURES, centers_of, modeled

from styletrf.colmap import pycolmap
from styletrf.configuration import configured
from styletrf.files.images import write_rgb
from styletrf.geometry.cameras import Camera, moved
from styletrf.geometry.lenses import at_size, focal_from, focal_of
from styletrf.trajectory.camera_path import TimedPath, frames_along
from styletrf.trajectory.chosen_path import chosen_path
from styletrf.trajectory.frames import FramesConfig
from styletrf.trajectory.key_frames import seconds_of_file
from styletrf.trajectory.named_paths import named_path, poses_of
from styletrf.trajectory.path_files import read_path
from styletrf.trajectory.trajectories import fly_through
from styletrf.trajectory.trajectory_config import TrajectoryConfig

painted_plane = cache(painted_plane)
NAMES = ("orbit", "spiral", "dolly", "photographs")
CONFIG = FramesConfig(trajectory=TrajectoryConfig(frames=40))


def assert_cameras(cameras) -> None:
    rotations = np.stack([camera.world_from_camera[:, :3] for camera in cameras])
    products = rotations.transpose(0, 2, 1) @ rotations
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), products.shape), atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(rotations), 1, rtol=1e-6)
    assert np.isfinite(centers_of(cameras)).all()
    assert all(camera.fx > 0 for camera in cameras)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("capture", CAPTURES)
def test_every_named_path_is_even_and_near_the_photographs(name, capture):
    views, model = modeled(capture)
    path = chosen_path(name, views, model, CONFIG, are_given=False)
    assert len(path) == 40
    assert_cameras(path)
    taken = centers_of(views)
    reach = np.linalg.norm(taken - np.array(model.focus), axis=1).max() + model.space.depth_min
    assert (np.linalg.norm(centers_of(path) - np.array(model.focus), axis=1) <= 1.2 * reach).all()
    steps = np.linalg.norm(np.diff(centers_of(path), axis=0), axis=1)
    assert steps.max() < 3 * steps.mean() + 1e-9


DEGENERATE = {
    "one": lambda cameras: cameras[:1],
    "two": lambda cameras: cameras[:2],
    "at one point": lambda cameras: [
        replace(
            camera,
            world_from_camera=np.column_stack(
                [camera.world_from_camera[:, :3], cameras[0].center_world]
            ),
        )
        for camera in cameras
    ],
    "the same one": lambda cameras: cameras[:1] * 5,
    "at the focus": lambda cameras: [
        replace(
            camera,
            world_from_camera=np.column_stack(
                [camera.world_from_camera[:, :3], np.array(painted_plane().model.focus)]
            ),
        )
        for camera in cameras
    ],
}


@pytest.mark.parametrize(
    ("name", "looking"),
    [
        *(("auto", looking) for looking in ("ahead", "inward", "outward", "along")),
        *product(("orbit", "spiral"), ("ahead", "inward", "outward")),
        ("dolly", "ahead"),  # the model's looking has no part in these two
        ("photographs", "ahead"),
    ],
)
@pytest.mark.parametrize("some", DEGENERATE)
def test_named_paths_of_degenerate_cameras_are_finite(name, some, looking):
    scene = painted_plane()
    cameras, model = DEGENERATE[some](scene.cameras), replace(scene.model, looking=looking)
    if name == "auto":
        assert_cameras(fly_through(cameras, model, CONFIG.trajectory))
    else:
        assert_cameras(chosen_path(name, cameras, model, CONFIG, are_given=False))


def test_photographs_without_smoothing_are_passed_one_by_one_in_their_order():
    views, model = modeled("way")
    found = named_path("photographs", views, model, TrajectoryConfig(stabilization=0.0)).poses
    np.testing.assert_allclose(found.centers, centers_of(views))


def test_stabilization_leaves_less_shaking():
    views, model = modeled("arc")

    def shaking(deviation: float) -> float:
        config = replace(CONFIG, trajectory=TrajectoryConfig(frames=80, stabilization=deviation))
        path = chosen_path("photographs", views, model, config, are_given=False)
        return float(np.linalg.norm(np.diff(centers_of(path), n=2, axis=0), axis=1).mean())

    assert shaking(0.0) > 2 * shaking(1.5) > 2 * shaking(6.0)


def test_a_dolly_is_straight_and_looks_one_way():
    views, model = modeled("forward")
    path = chosen_path("dolly", views, model, CONFIG, are_given=False)
    way = centers_of(path) - path[0].center_world
    along = way @ path[0].forward_world
    np.testing.assert_allclose(way, np.outer(along, path[0].forward_world), atol=1e-9)
    assert (np.diff(along) > 0).all()
    assert path[-1].forward_world == pytest.approx(path[0].forward_world)


@pytest.mark.parametrize("name", ["orbit", "spiral"])
def test_an_orbit_and_a_spiral_return(name):
    views, model = modeled("ring")
    path = chosen_path(name, views, model, CONFIG, are_given=False)
    steps = np.linalg.norm(np.diff(centers_of([*path, path[0]]), axis=0), axis=1)
    assert steps[-1] == pytest.approx(steps.mean(), rel=0.2)


@pytest.mark.parametrize(
    ("words", "count"),
    [
        ({}, 60),
        ({"trajectory.speed": 2.0}, 30),
        ({"trajectory.seconds": 2.0}, 48),
        ({"trajectory.seconds": 2.0, "frames_per_second": 60}, 120),
        ({"trajectory.seconds": 2.0, "trajectory.speed": 0.5}, 96),
        ({"trajectory.speed": 1e9}, 1),
    ],
)
def test_length_rate_and_speed_decide_the_number_of_frames(words, count):
    views, model = modeled("forward")
    config = configured(FramesConfig, words)
    assert len(chosen_path("orbit", views, model, config, are_given=False)) == count


@pytest.mark.parametrize(
    "words",
    [
        {"trajectory.seconds": -1.0}, {"trajectory.seconds": float("nan")},
        {"trajectory.speed": 0.0}, {"trajectory.easing": 1.5}, {"trajectory.fov_deg": 180.0},
        {"trajectory.stabilization": -1.0}, {"frames_per_second": 23}, {"frames_per_second": 61},
        {"long_side_px": 63}, {"long_side_px": 4096}, {"support.depth_px": 0},
    ],
)  # fmt: skip
def test_values_out_of_range_are_refused(words):
    with rejects(f"setting {next(iter(words))!r}"):
        configured(FramesConfig, words)


@pytest.mark.parametrize("fov_deg", [20.0, 90.0])
def test_the_angle_of_view_is_along_the_longer_side(fov_deg):
    for width, height in ((64, 48), (48, 64)):
        camera = at_size(Camera("c", width, height, 50.0, 50.0, 1.0, 2.0, np.eye(3, 4)), 0, fov_deg)
        longer = max(width, height)
        focal_px = camera.fx
        assert 2 * np.degrees(np.arctan(longer / 2 / focal_px)) == pytest.approx(fov_deg)
        assert (camera.cx, camera.cy) == (width / 2, height / 2)


def test_frames_may_be_larger_than_the_photographs():
    camera = at_size(Camera("c", 64, 48, 50.0, 50.0, 32.0, 24.0, np.eye(3, 4)), 3840, 0.0)
    assert (camera.width, camera.height) == (3840, 2880)
    assert focal_of(camera) == pytest.approx(50 / 64)


def test_timed_key_frames_are_met_at_their_frames():
    views, _ = modeled("walk")
    path = TimedPath(poses_of(views[:4]), times_s=(0.0, 0.5, 1.0, 3.0))
    frames = frames_along(path, views[0], TrajectoryConfig(), 24)
    assert len(frames) == 3 * 24 + 1
    for view, time_s in zip(views, path.times_s, strict=False):
        frame = frames[round(24 * time_s)]
        np.testing.assert_allclose(frame.world_from_camera, view.world_from_camera, atol=1e-9)


@pytest.fixture
def scene():
    return painted_plane()


def in_the_world(scene, camera) -> Camera:
    return moved(camera, np.linalg.inv(scene.model.normalized_from_world))


def test_key_frames_lie_where_the_capture_has_them(scene, tmp_path):
    """By a photograph's name, and by its place in the world, a frame is the photograph."""
    first, last = scene.cameras[0], scene.cameras[-1]
    world = in_the_world(scene, last)
    quaternion = poses_of([world]).quaternions[0].tolist()
    values = {
        "key_frames": [
            {"photograph": first.name},
            {"position": world.center_world.tolist(), "orientation": quaternion, "fov_deg": 40},
        ]
    }
    (tmp_path / "p.json").write_text(json.dumps(values))
    path = chosen_path(
        str(tmp_path / "p.json"), scene.cameras, scene.model, CONFIG, are_given=False
    )
    np.testing.assert_allclose(path[0].world_from_camera, first.world_from_camera, atol=1e-9)
    np.testing.assert_allclose(path[-1].world_from_camera, last.world_from_camera, atol=1e-9)
    assert focal_of(path[0]) == pytest.approx(focal_of(first))
    assert focal_of(path[-1]) == pytest.approx(focal_from(40.0))


def test_a_key_frame_looks_at_its_point(scene, tmp_path):
    center, target = in_the_world(scene, scene.cameras[1]).center_world, np.array([0.3, 0.2, 4.0])
    entry = {"position": center.tolist(), "look_at": target.tolist()}
    (tmp_path / "p.json").write_text(json.dumps({"key_frames": [entry]}))
    (frame, *_) = chosen_path(
        str(tmp_path / "p.json"), scene.cameras, scene.model, CONFIG, are_given=False
    )
    to_target = target - center
    found = in_the_world(scene, frame)
    assert found.forward_world == pytest.approx(to_target / np.linalg.norm(to_target))


def test_an_unknown_photograph_is_answered_with_those_there_are(scene, tmp_path):
    file = tmp_path / "p.json"
    file.write_text(json.dumps({"key_frames": [{"photograph": "0"}, {"photograph": "moon"}]}))
    with rejects(file, "key_frames[1].photograph", "'moon'", remedy=[0, 1, 2]):
        chosen_path(str(file), scene.cameras, scene.model, CONFIG, are_given=False)


def write_blender(folder, scene):
    flip = np.diag([1.0, -1.0, -1.0, 1.0])
    worlds = [in_the_world(scene, camera) for camera in scene.cameras]
    poses = [np.vstack([world.world_from_camera, [0, 0, 0, 1]]) @ flip for world in worlds]
    frames = [
        {"file_path": f"./{k:04d}", "transform_matrix": pose.tolist()}
        for k, pose in enumerate(poses)
    ]
    fov = 2 * np.arctan(0.5 / focal_of(scene.cameras[0]))
    (folder / "transforms.json").write_text(json.dumps({"camera_angle_x": fov, "frames": frames}))
    return folder / "transforms.json"


def test_cameras_of_a_path_need_no_photographs(scene, tmp_path):
    """No key holds them, so their size does not count: the file gives it, or is refused."""
    file = write_blender(tmp_path, scene)
    before = read_path(file)
    write_rgb(tmp_path / "0000.png", np.zeros((20, 10, 3), np.float32))
    assert read_path(file) == before
    content = json.loads(file.read_text())
    angle = content.pop("camera_angle_x")
    focal = 0.5 * 40 / np.tan(angle / 2)
    file.write_text(json.dumps({**content, "fl_x": focal, "w": 40, "h": 30}))
    assert np.isclose(read_path(file).frames[0].fov_deg, before.frames[0].fov_deg)
    file.write_text(json.dumps({**content, "fl_x": focal}))
    with rejects(file, "lens"):
        read_path(file)


def write_colmap(folder, scene):
    model = pycolmap.Reconstruction()
    usual = scene.cameras[0]
    params = [usual.fx, usual.fy, usual.cx, usual.cy]
    lens = pycolmap.Camera(
        model="PINHOLE", width=usual.width, height=usual.height, params=params, camera_id=1
    )
    model.add_camera_with_trivial_rig(lens)
    for k, camera in enumerate(scene.cameras):
        pose = in_the_world(scene, camera).world_from_camera
        world_from_camera = pycolmap.Rigid3d(pycolmap.Rotation3d(pose[:, :3]), pose[:, 3])
        image = pycolmap.Image(name=f"{k:04d}.png", camera_id=1, image_id=k + 1)
        model.add_image_with_trivial_frame(image, world_from_camera.inverse())
    model.write_text(folder)
    return folder


@pytest.mark.parametrize("write", [write_blender, write_colmap])
def test_cameras_of_other_programs_are_key_frames_in_the_given_world(scene, tmp_path, write):
    file = write(tmp_path, scene)
    keys = read_path(file)
    assert len(keys.frames) == len(scene.cameras)
    with rejects(file, "world"):
        chosen_path(str(file), scene.cameras, scene.model, CONFIG, are_given=False)
    path = chosen_path(str(file), scene.cameras, scene.model, CONFIG, are_given=True)
    for frame, view in ((path[0], scene.cameras[0]), (path[-1], scene.cameras[-1])):
        np.testing.assert_allclose(frame.world_from_camera, view.world_from_camera, atol=1e-7)
        assert focal_of(frame) == pytest.approx(focal_of(view))


def test_an_animation_of_blender_keeps_its_frames(scene, tmp_path):
    file = write_blender(tmp_path, scene)
    assert seconds_of_file(file) == read_path(file).seconds > 0
    path = chosen_path(str(file), scene.cameras, scene.model, CONFIG, are_given=True)
    for frame, view in zip(path, scene.cameras, strict=True):
        np.testing.assert_allclose(frame.world_from_camera, view.world_from_camera, atol=1e-7)
