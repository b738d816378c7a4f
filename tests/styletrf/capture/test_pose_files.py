"""Files of poses: what is refused, and which photographs they name."""

import json

import numpy as np
import pytest
from expected_errors import rejects
from given_cameras import colmap, photographed
from made_photographs import room_poses
from posed_scenes import PINHOLE, as_opengl, llff, ngp_with

from styletrf.capture.poses.pose_formats import find_given_poses
from styletrf.capture.user_folders import scene_files


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
