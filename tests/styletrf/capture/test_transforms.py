"""What `transforms.json` says of lenses and photographs, and what is refused there."""

import json

import numpy as np
import pytest
from expected_errors import rejects
from made_photographs import encoded, texture

from styletrf.capture.poses.pose_formats import find_given_poses
from styletrf.capture.poses.transforms_frames import transforms_photographs
from styletrf.capture.poses.transforms_json import read_transforms, transforms_cameras

LENS = {"w": 60, "h": 40, "fl_x": 50.0, "cx": 30.0, "cy": 20.0}


def scene(folder, files=("1.png", "2.png", "3.png"), **of_all):
    """Photographs, and poses that name these files."""
    for name in ("1.png", "2.png", "3.png", "4.png"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(encoded(texture(40, 60), ".png"))
    frames = [{"file_path": str(file), "transform_matrix": np.eye(4).tolist()} for file in files]
    (folder / "transforms.json").write_text(json.dumps({**LENS, **of_all, "frames": frames}))
    return folder


@pytest.mark.parametrize(
    ("bends", "model", "params"),
    [
        ({"k1": 0.1, "k3": 0.0, "k4": None}, "OPENCV", [0.1, 0, 0, 0]),
        ({"k1": 0.1, "p2": 0.01, "k3": -0.02}, "FULL_OPENCV", [0.1, 0, 0, 0.01, -0.02, 0, 0, 0]),
        ({"k3": 0.3, "k4": 0.0}, "FULL_OPENCV", [0, 0, 0, 0, 0.3, 0, 0, 0]),
        ({"k3": 0.3, "k4": 0.1, "is_fisheye": True}, "OPENCV_FISHEYE", [0, 0, 0.3, 0.1]),
        ({"k3": 0.0, "camera_model": "PINHOLE"}, "PINHOLE", []),
    ],
)
def test_the_third_coefficient_of_a_distortion_is_read(tmp_path, bends, model, params):
    """It was ignored, so that straight lines stayed bent."""
    lens = read_transforms(scene(tmp_path, **bends)).views[0].lens
    assert (lens.model, list(lens.params)) == (model, [50.0, 50.0, 30.0, 20.0, *params])


def test_lenses_of_one_file_have_one_model(tmp_path):
    """One frame without a third coefficient made the lenses two models, which are refused."""
    path = scene(tmp_path, k1=0.1, k3=0.05) / "transforms.json"
    fields = json.loads(path.read_text())
    fields["frames"][0] |= {"k3": 0.0}
    fields["frames"][1] |= {"k1": 0.0, "k3": 0.0}
    path.write_text(json.dumps(fields))
    lenses = [view.lens for view in read_transforms(tmp_path).views]
    assert [lens.model for lens in lenses] == ["FULL_OPENCV"] * 3
    bends = [[0.1, *[0] * 7], [0] * 8, [0.1, 0, 0, 0, 0.05, 0, 0, 0]]
    assert [list(lens.params[4:]) for lens in lenses] == bends


def test_a_lens_without_distortion_has_the_model_of_those_beside_it(tmp_path):
    """Two cameras, of which one bends nothing, were two models, which are refused."""
    path = scene(tmp_path) / "transforms.json"
    fields = json.loads(path.read_text())
    fields["frames"][1] |= {"k1": 0.1}
    path.write_text(json.dumps(fields))
    lenses = [view.lens for view in read_transforms(tmp_path).views]
    assert [lens.model for lens in lenses] == ["OPENCV"] * 3
    assert [list(lens.params[4:]) for lens in lenses] == [[0] * 4, [0.1, 0, 0, 0], [0] * 4]


def without_sizes(folder, of_all, of_frame):
    """Photographs of which the second stands, and lenses that do not say for which size."""
    path = scene(folder) / "transforms.json"
    (folder / "2.png").write_bytes(encoded(texture(60, 40), ".png"))
    frames = [{**of_frame, **frame} for frame in json.loads(path.read_text())["frames"]]
    path.write_text(json.dumps({**of_all, "frames": frames}))
    return [view.lens for view in read_transforms(folder).views]


@pytest.mark.parametrize("lens", [{"camera_angle_x": 0.8}, {"fl_x": 50.0}])
def test_a_lens_of_a_whole_file_without_a_size_is_one_lens(tmp_path, lens):
    """A photograph that stands had a lens as wide as the longer side of the others."""
    lenses = without_sizes(tmp_path, lens, {})
    assert len(set(lenses)) == 1
    assert (lenses[0].width, lenses[0].height) == (60, 40)


@pytest.mark.parametrize("lens", [{"camera_angle_x": 0.8}, {"fl_x": 50.0}])
@pytest.mark.parametrize("shape", [(60, 60), (40, 120), (120, 40)])
def test_a_photograph_of_another_format_has_the_lens_of_the_file_at_its_own_size(
    tmp_path, lens, shape
):
    """It was stretched: a square photograph had the pixels of one that is not."""
    path = scene(tmp_path) / "transforms.json"
    (tmp_path / "2.png").write_bytes(encoded(texture(*shape), ".png"))
    path.write_text(json.dumps({**lens, "frames": json.loads(path.read_text())["frames"]}))
    first, other, third = [view.lens for view in read_transforms(tmp_path).views]
    assert (other.height, other.width) == shape
    assert other.params[0] == other.params[1]
    assert first == third != other


def test_photographs_of_one_format_have_one_lens_also_where_their_sizes_are_rounded(tmp_path):
    path = scene(tmp_path) / "transforms.json"
    (tmp_path / "2.png").write_bytes(encoded(texture(27, 40), ".png"))
    frames = json.loads(path.read_text())["frames"]
    path.write_text(json.dumps({"camera_angle_x": 0.8, "frames": frames}))
    assert len({view.lens for view in read_transforms(tmp_path).views}) == 1


def test_a_lens_of_one_frame_without_a_size_is_that_of_its_photograph(tmp_path):
    lenses = without_sizes(tmp_path, {}, {"camera_angle_x": 0.8})
    assert [(lens.width, lens.height) for lens in lenses] == [(60, 40), (40, 60), (60, 40)]


def test_photographs_are_in_natural_order_and_the_cameras_of_a_path_in_that_of_the_file(tmp_path):
    names = ["3.png", "1.png", "2.png"]
    folder = scene(tmp_path, names)
    assert [view.file.name for view in read_transforms(folder).views] == sorted(names)
    cameras = transforms_cameras(folder / "transforms.json")
    assert [view.file.name for view in cameras] == names


@pytest.mark.parametrize("name", ["k4", "k5", "k6"])
def test_a_coefficient_that_is_not_read_is_refused(tmp_path, name):
    with rejects(tmp_path / "transforms.json", name):
        read_transforms(scene(tmp_path, camera_model="FULL_OPENCV", k3=0.1, **{name: 0.3}))
    with rejects(tmp_path / "transforms.json", name):
        read_transforms(scene(tmp_path, **{name: 0.01}))


@pytest.mark.parametrize("size", [{"w": 0}, {"h": 0}, {"w": -60}])
def test_a_lens_of_no_size_is_refused(tmp_path, size):
    path = scene(tmp_path, **size) / "transforms.json"
    for read in (read_transforms, transforms_cameras):
        with rejects(path, "lens"):
            read(path.parent if read is read_transforms else path)


def test_a_path_has_the_poses_of_any_lens(tmp_path):
    path = scene(tmp_path, k4=0.01) / "transforms.json"
    assert [view.file.name for view in transforms_cameras(path)] == ["1.png", "2.png", "3.png"]


@pytest.mark.parametrize("other", ["./2", "below/../2.png"])
def test_a_photograph_with_two_poses_is_refused(tmp_path, other):
    """It got the last one, and photographs other names."""
    (tmp_path / "below").mkdir()
    with rejects(tmp_path / "transforms.json", "2.png"):
        read_transforms(scene(tmp_path, ["1.png", "2.png", "3.png", other]))


def test_a_photograph_that_is_missing_may_be_named_twice(tmp_path):
    found = read_transforms(scene(tmp_path, ["1.png", "2.png", "3.png", "5.png", "5.png"]))
    assert found.missing == ("5.png", "5.png")


def test_a_lens_that_bends_lines_and_whose_axis_misses_the_picture_is_refused(tmp_path):
    """The search for a pinhole camera without blank pixels did not end."""
    with rejects("photograph 3.png", "-5.0"):
        find_given_poses(scene(tmp_path, cx=-5.0, k1=-0.1))


def test_a_part_of_a_picture_without_its_center_has_its_poses(tmp_path):
    assert len(find_given_poses(scene(tmp_path, cx=-5.0)).views) == 3


def test_an_absolute_path_through_a_link_is_that_below_the_scene(tmp_path):
    """The scene's key ended in a traceback where the user's data lie behind a link."""
    folder = tmp_path / "disk/walk"
    scene(folder, [folder / "1.png", folder / "2", "3.png"])
    (tmp_path / "data").symlink_to(tmp_path / "disk")
    linked = tmp_path / "data/walk"
    files = [view.file for view in read_transforms(linked).views]
    assert files == [linked / "1.png", linked / "2.png", linked / "3.png"]


@pytest.mark.parametrize("length", [300, 5000])
def test_a_photograph_by_a_name_too_long_for_a_file_is_missing(tmp_path, length):
    """The command ended in a traceback."""
    found = read_transforms(scene(tmp_path, ["1.png", "2.png", "3.png", "x" * length]))
    assert [view.file.name for view in found.views] == ["1.png", "2.png", "3.png"]
    assert found.missing == ("x" * length,)
    assert len(transforms_photographs(tmp_path)) == 3


def test_a_file_with_a_byte_order_mark_is_read_as_one_without(tmp_path):
    lenses = [view.lens for view in read_transforms(scene(tmp_path)).views]
    path = tmp_path / "transforms.json"
    path.write_text(path.read_text(), encoding="utf-8-sig")
    assert [view.lens for view in read_transforms(tmp_path).views] == lenses
