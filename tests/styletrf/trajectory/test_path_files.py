"""Paths in files: key frames and cameras of other programs, where they are in the scene."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from expected_errors import rejects
from mini_scene import painted_plane

from styletrf.colmap import pycolmap
from styletrf.files.images import write_rgb
from styletrf.geometry.cameras import Camera, moved
from styletrf.geometry.lenses import focal_from, focal_of
from styletrf.geometry.rotations import angles_between
from styletrf.trajectory.chosen_path import chosen_path
from styletrf.trajectory.frames import FramesConfig
from styletrf.trajectory.key_frames import seconds_of_file
from styletrf.trajectory.named_paths import poses_of
from styletrf.trajectory.path_files import placed_key_frames, read_path
from styletrf.trajectory.trajectory_config import TrajectoryConfig

painted_plane = cache(painted_plane)
CONFIG = FramesConfig(trajectory=TrajectoryConfig(frames=40))


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


LYING = {
    "as it is": np.eye(3),
    "to the left": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
    "to the right": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "on its head": np.diag([-1.0, -1, 1]),
}


@pytest.mark.parametrize("write", [write_blender, write_colmap])
@pytest.mark.parametrize("side", LYING)
def test_cameras_of_photographs_that_are_stored_lying_stand_as_their_photographs(
    scene, tmp_path, write, side
):
    """A model of a phone's pictures as they are stored was rolled, unlike the capture."""
    lying = [
        replace(
            camera,
            world_from_camera=np.column_stack(
                [camera.world_from_camera[:, :3] @ LYING[side], camera.center_world]
            ),
        )
        for camera in scene.cameras
    ]
    keys = read_path(write(tmp_path, replace(scene, cameras=lying)))
    of_one_missing = scene.cameras[:2] + scene.cameras[3:]
    placed = placed_key_frames(keys, of_one_missing, scene.model, are_given=True)
    upright = poses_of(scene.cameras)
    np.testing.assert_allclose(placed.centers, upright.centers, atol=1e-6)
    assert angles_between(placed.quaternions, upright.quaternions).max() < 1e-6


def test_cameras_that_roll_where_no_photograph_is_keep_their_roll(scene, tmp_path):
    elsewhere = np.column_stack([LYING["to the left"], [0.0, 0.0, 0.5]])
    away = [moved(camera, np.vstack([elsewhere, [0, 0, 0, 1]])) for camera in scene.cameras]
    assert_kept(tmp_path, scene, scene.cameras, away)


def assert_kept(folder, scene, photographs, cameras):
    """The file's cameras are those of the path, whatever the photographs are."""
    keys = read_path(write_colmap(folder, replace(scene, cameras=cameras)))
    placed = placed_key_frames(keys, photographs, scene.model, are_given=True)
    assert angles_between(placed.quaternions, poses_of(cameras).quaternions).max() < 1e-6


def flight(places, headings):
    """Cameras of a drone that look down from places along x and y, turned by quarters."""
    cameras = []
    for place, heading in zip(places, headings, strict=True):
        turn = np.linalg.matrix_power(LYING["to the right"].astype(int), int(heading))
        pose = np.column_stack([turn, [*place, 0.0]])
        cameras.append(Camera("d", 40, 30, 40.0, 40.0, 20.0, 15.0, pose))
    return cameras


def test_an_animation_over_photographs_of_a_drone_that_flies_back_and_forth_is_not_turned(
    scene, tmp_path
):
    """Each second line of the flight stands on its head."""
    lines = [(x, y) for y in (0.0, 0.2) for x in np.linspace(0, 1, 11)]
    there = flight(lines, np.repeat([0, 2], 11))
    dense = [(x, y) for y in (0.0, 0.2) for x in np.linspace(0, 1, 60)]
    assert_kept(tmp_path, scene, there, flight(dense, np.zeros(120)))


def test_cameras_stay_where_photographs_of_one_place_are_rolled_from_each_other(scene, tmp_path):
    places = [(x, 0.0) for x in np.linspace(0, 1, 11)]
    there = flight([*places, *places], np.repeat([2, 0], 11))
    assert_kept(tmp_path, scene, there, flight(places, np.zeros(11)))


def test_the_angle_of_view_of_a_panorama_is_left_to_the_photographs(scene, tmp_path):
    """COLMAP ends the process that asks for the focal length of such a lens."""
    model = pycolmap.Reconstruction()
    size = {"width": 200, "height": 100}
    lens = pycolmap.Camera(model="EQUIRECTANGULAR", params=[200, 100], camera_id=1, **size)
    model.add_camera_with_trivial_rig(lens)
    image = pycolmap.Image(name="a.png", camera_id=1, image_id=1)
    model.add_image_with_trivial_frame(image, pycolmap.Rigid3d())
    model.write_text(tmp_path)
    assert [frame.fov_deg for frame in read_path(tmp_path).frames] == [None]


def test_the_angle_of_view_of_a_portrait_camera_is_along_its_height(tmp_path):
    lens = {"fl_x": 1000.0, "fl_y": 1100.0, "w": 1080, "h": 1920}
    frame = {"file_path": "0", "transform_matrix": np.eye(4).tolist()}
    file = tmp_path / "transforms.json"
    file.write_text(json.dumps({**lens, "frames": [frame]}))
    camera = Camera("c", 1080, 1920, 1000.0, 1100.0, 540.0, 960.0, np.eye(3, 4))
    assert focal_from(read_path(file).frames[0].fov_deg) == pytest.approx(focal_of(camera))


@pytest.mark.parametrize("is_folder", [False, True])
def test_cameras_that_cannot_be_read_are_refused_with_what_helps_a_path(tmp_path, is_folder):
    """The remedy was for poses of a capture: then poses are estimated."""
    file = tmp_path / "transforms.json"
    file.write_text(json.dumps({"frames": [{"file_path": "0"}]}))
    path = tmp_path if is_folder else file
    with rejects(path) as error:
        read_path(path)
    assert "--path" in error.value.remedy
    assert "estimated" not in error.value.remedy
