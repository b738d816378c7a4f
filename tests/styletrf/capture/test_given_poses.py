"""Scenes that already have poses, in every format, held to their photographs by reprojection."""

import json
import re
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from expected_errors import rejects
from given_cameras import BENT, FOCAL, HEIGHT, VIEWS, WIDTH, colmap, photographed
from made_photographs import room_poses
from message_words import mentions

from styletrf.capture.capture_file import read_capture
from styletrf.capture.poses.pose_formats import find_given_poses
from styletrf.capture.scene_capture import capture_photographs, given_views
from styletrf.capture.user_folders import scene_files
from styletrf.geometry.camera_table import read_cameras, read_fitted_rows, read_split
from styletrf.geometry.cameras import project
from styletrf.geometry.point_table import read_points
from styletrf.sfm.camera_poses import CameraPosesConfig, solve_camera_poses

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


@pytest.fixture(
    scope="module",
    params=[blender, instant_ngp, third_coefficient, nerfstudio_fisheye, llff, colmap, colmap_text],
)
def given(request, tmp_path_factory):
    """A scene with poses, after SceneCapture and CameraPoses."""
    folder, poses = tmp_path_factory.mktemp("given"), room_poses(VIEWS)
    request.param(folder, poses)
    found = find_given_poses(folder)
    capture_photographs(folder / "images", folder / "capture", given=found)
    (folder / "out").mkdir()
    report = solve_camera_poses(
        folder / "capture",
        folder / "out",
        CameraPosesConfig(max_features=512),
        log_dir=folder / "log",
    )
    return request.param, folder, poses, report


def test_solved_cameras_have_the_poses_that_were_given(given):
    _, folder, poses, report = given
    cameras = read_cameras(folder / "out" / "cameras.parquet")
    assert (report.registered, report.total) == (VIEWS, VIEWS)
    assert report.mapper.startswith("given by")
    assert report.doubts == ()
    assert (report.lens_settings, report.focal_prior_px) == (1, None)
    for camera, pose in zip(cameras, poses, strict=True):
        np.testing.assert_allclose(camera.world_from_camera, pose, atol=1e-6)


def test_points_project_where_they_were_seen(given):
    """A wrong axis, half a pixel or a lens not heeded would show."""
    _, folder, _, report = given
    assert report.mean_reprojection_error_px < 0.5
    points = read_points(folder / "out" / "points.parquet")
    assert len(points.xyz_world) > 100
    for index, camera in enumerate(read_cameras(folder / "out" / "cameras.parquet")):
        seen = points.observed_image == index
        pixels, depth = project(camera, points.xyz_world[points.observed_point[seen]])
        assert (depth > 0).all()
        assert np.median(np.linalg.norm(pixels - points.observed_pixel[seen], axis=1)) < 0.5
    on_a_wall = np.abs(points.xyz_world).min(axis=1)
    assert np.median(on_a_wall) < 0.01, "where the room's walls are"


def test_a_published_split_is_kept_and_else_a_view_in_the_middle_is_held_out(given):
    kind, folder, _, _ = given
    table = folder / "out" / "cameras.parquet"
    train, held_out = read_split(table)
    cameras = read_cameras(table)
    rows = read_fitted_rows(table)
    assert [cameras[row].name for row in rows] == [camera.name for camera in train]
    if kind is blender:
        assert [camera.name for camera in held_out] == [f"test_r_{i}" for i in range(VIEWS // 2)]
        assert len(train) == VIEWS // 2
    else:
        assert [camera.name for camera in held_out] == [f"{VIEWS // 2}"]


def test_photographs_without_a_pose_and_poses_without_a_photograph_are_named(given):
    kind, folder, _, _ = given
    warnings = read_capture(folder / "capture").warnings
    if kind is instant_ngp:
        for name in (f"{VIEWS}.png", "extra.png"):
            assert any(mentions(warning, name) for warning in warnings)
    else:
        assert warnings == ()


@pytest.mark.parametrize("images", ["missing", "empty"])
@pytest.mark.parametrize("write", [llff, colmap])
def test_photographs_with_poses_may_lie_in_the_scenes_own_folder(tmp_path, write, images):
    """They were sought in `images` alone, also if it was empty, so that the scene was refused."""
    write(tmp_path, room_poses(3))
    in_images = find_given_poses(tmp_path).views
    for file in (tmp_path / "images").iterdir():
        file.rename(tmp_path / file.name)
    if images == "missing":
        (tmp_path / "images").rmdir()
    views = find_given_poses(tmp_path).views
    assert [view.file for view in views] == [tmp_path / view.file.name for view in in_images]
    assert [view.lens for view in views] == [view.lens for view in in_images]
    assert {view.file for view in views} <= set(scene_files(tmp_path))


def test_poses_are_named_by_their_file_or_by_their_folder_and_the_one_above(tmp_path):
    """Warnings and reports called a COLMAP model `0`."""
    for write, name in ((llff, "poses_bounds.npy"), (colmap, "sparse/0")):
        write(tmp_path / write.__name__, room_poses(4))
        (tmp_path / write.__name__ / "images").mkdir(exist_ok=True)
        found = find_given_poses(tmp_path / write.__name__)
        assert found.name == name
    (tmp_path / "colmap/images/3.png").rename(tmp_path / "colmap/images/9.png")
    found = find_given_poses(tmp_path / "colmap")
    capture_photographs(tmp_path / "colmap/images", tmp_path / "out", given=found)
    assert given_views(tmp_path / "out")[0] == "sparse/0"
    warnings = read_capture(tmp_path / "out").warnings
    assert len(warnings) == 2
    assert all(mentions(warning, "sparse/0") for warning in warnings)


def test_poses_can_be_solved_all_the_same_and_the_published_split_is_kept(tmp_path):
    """Another one was made, whose measures are not those that others publish."""
    blender(tmp_path, room_poses(VIEWS))
    found = find_given_poses(tmp_path)
    capture_photographs(tmp_path / "images", tmp_path / "capture", given=found)
    (tmp_path / "out").mkdir()
    config = CameraPosesConfig(poses="solved", max_features=512)
    report = solve_camera_poses(tmp_path / "capture", tmp_path / "out", config, log_dir=tmp_path)
    assert report.mapper in ("global", "incremental")
    _, held_out = read_split(tmp_path / "out" / "cameras.parquet")
    assert {camera.name for camera in held_out} == {f"test_r_{i}" for i in range(VIEWS // 2)}


def solved_with_rows(folder, change):
    llff(folder, room_poses(VIEWS))
    np.save(folder / "poses_bounds.npy", change(np.load(folder / "poses_bounds.npy")))
    found = find_given_poses(folder)
    capture_photographs(folder / "images", folder / "capture", given=found)
    (folder / "out").mkdir()
    return solve_camera_poses(
        folder / "capture", folder / "out", CameraPosesConfig(max_features=512)
    )


def test_poses_of_another_convention_are_refused(tmp_path):
    """Camera from world where world from camera is wanted: another center."""

    def inverted(rows):
        poses = rows[:, :15].reshape(-1, 3, 5)
        poses[:, :, 3] = -np.einsum("nji,nj->ni", poses[:, :, :3], poses[:, :, 3])
        return np.column_stack([poses.reshape(-1, 15), rows[:, 15:]])

    with rejects(Path("poses_bounds.npy")):
        solved_with_rows(tmp_path, inverted)


def test_poses_in_the_wrong_order_have_a_warning(tmp_path):
    """Along an even arc the photograph's neighbor stood about as the photograph itself."""
    report = solved_with_rows(tmp_path, lambda rows: np.roll(rows, 3, axis=0))
    assert any(re.search(r"\d%", warning) for warning in report.warnings)


def ngp_with(folder, **changes):
    instant_ngp(folder, room_poses(3))
    content = json.loads((folder / "transforms.json").read_text())
    content["frames"][1] |= changes.pop("frame", {})
    (folder / "transforms.json").write_text(json.dumps(content | changes))
    return folder


MIRROR = np.diag([1.0, 1.0, -1.0, 1.0])


@pytest.mark.parametrize(
    ("changes", "value"),
    [
        ({"frame": {"transform_matrix": np.zeros((4, 4)).tolist()}}, "rotation"),
        ({"frame": {"transform_matrix": MIRROR.tolist()}}, "rotation"),
        ({"frame": {"transform_matrix": [[1, 2], [3, 4]]}}, "3x4"),
        ({"frame": {"transform_matrix": "none"}}, "transforms"),
        ({"fl_x": -1}, "-1.0"),
        ({"fl_x": "wide"}, "wide"),
        ({"w": float("inf")}, "lens"),
        ({"h": 10**400}, "lens"),
        ({"camera_model": "EQUIRECTANGULAR"}, "EQUIRECTANGULAR"),
        ({"frames": []}, "0"),
        ({"frames": [{"file_path": "gone"}]}, "transforms"),
    ],
)
def test_a_transforms_file_that_cannot_be_used_is_refused(tmp_path, changes, value):
    with rejects(tmp_path / "transforms.json", value):
        find_given_poses(ngp_with(tmp_path, **changes))


def test_a_pose_with_a_scale_is_a_rotation_all_the_same(tmp_path):
    matrix = np.array(as_opengl(room_poses(3)[1]))
    matrix[:3, :3] *= 2.5
    found = find_given_poses(ngp_with(tmp_path, frame={"transform_matrix": matrix.tolist()}))
    np.testing.assert_allclose(found.views[1].world_from_camera, room_poses(3)[1], atol=1e-9)


def test_a_matrix_of_three_rows_is_the_pose_that_four_are(tmp_path):
    poses = room_poses(3)
    three_rows = as_opengl(poses[1])[:3]
    found = find_given_poses(ngp_with(tmp_path, frame={"transform_matrix": three_rows}))
    for view, pose in zip(found.views, poses, strict=True):
        np.testing.assert_allclose(view.world_from_camera, pose, atol=1e-9)


def outside_by_dots(scene, elsewhere):
    return f"../{elsewhere.name}/secret.png"


def outside_by_its_path(scene, elsewhere):
    return str(elsewhere / "secret.png")


def outside_without_its_suffix(scene, elsewhere):
    return f"../{elsewhere.name}/secret"


def outside_by_a_link(scene, elsewhere):
    (scene / "images" / "link.png").symlink_to(elsewhere / "secret.png")
    return "images/link.png"


def outside_by_a_linked_folder(scene, elsewhere):
    (scene / "linked").symlink_to(elsewhere)
    return "linked/secret.png"


def outside_and_not_there(scene, elsewhere):
    return f"../{elsewhere.name}/missing.png"


def by_a_loop_of_links(scene, elsewhere):
    (scene / "loop.png").symlink_to(scene / "loop.png")
    return "loop.png"


def by_no_name_of_a_file(scene, elsewhere):
    return "images/\0.png"


OUTSIDE = [
    outside_by_dots,
    outside_by_its_path,
    outside_without_its_suffix,
    outside_by_a_link,
    outside_by_a_linked_folder,
    outside_and_not_there,
    by_a_loop_of_links,
    by_no_name_of_a_file,
]


@pytest.mark.parametrize("name_of", OUTSIDE)
def test_photographs_outside_the_scene_are_refused(tmp_path, name_of):
    """They were copied into the store, and no key covered them."""
    scene, elsewhere = tmp_path / "scene", tmp_path / "elsewhere"
    scene.mkdir()
    ngp_with(scene)
    photographed(elsewhere, PINHOLE, room_poses(1), ["secret.png"])
    ngp = json.loads((scene / "transforms.json").read_text())
    ngp["frames"][1]["file_path"] = name_of(scene, elsewhere)
    (scene / "transforms.json").write_text(json.dumps(ngp))
    for read in (find_given_poses, scene_files):
        with rejects(scene / "transforms.json", scene):
            read(scene)


def test_a_colmap_model_that_names_photographs_outside_is_refused(tmp_path):
    colmap(tmp_path, room_poses(3), text=True)
    images = tmp_path / "sparse" / "0" / "images.txt"
    images.write_text(images.read_text().replace(" 1.png", " ../../1.png"))
    with rejects(tmp_path / "sparse" / "0", tmp_path / "images"):
        find_given_poses(tmp_path)


def test_a_linked_folder_of_photographs_serves_a_colmap_model(tmp_path):
    """The photographs' folder may lie on another disk: each file in it is in the key."""
    colmap(tmp_path / "scene", room_poses(3))
    (tmp_path / "scene" / "images").rename(tmp_path / "disk")
    (tmp_path / "scene" / "images").symlink_to(tmp_path / "disk")
    found = find_given_poses(tmp_path / "scene")
    assert {view.file for view in found.views} <= set(scene_files(tmp_path / "scene" / "images"))


def test_all_photographs_that_transforms_name_are_in_the_key(tmp_path):
    """Also one whose name has no suffix of an image, and what a link within the scene leads to."""
    ngp_with(tmp_path, frame={"file_path": "images/frame"})
    (tmp_path / "images" / "1.png").rename(tmp_path / "images" / "frame")
    (tmp_path / "linked").symlink_to(tmp_path / "images")
    ngp = json.loads((tmp_path / "transforms.json").read_text())
    ngp["frames"][2]["file_path"] = "linked/2.png"
    (tmp_path / "transforms.json").write_text(json.dumps(ngp))
    found = find_given_poses(tmp_path)
    assert len(found.views) == 3
    assert {view.file for view in found.views} <= set(scene_files(tmp_path))


def test_a_folder_without_poses_gives_none(tmp_path):
    photographed(tmp_path, PINHOLE, room_poses(3))
    assert find_given_poses(tmp_path) is None
