import hashlib
import re

import numpy as np
import pytest
from expected_errors import rejects
from made_photographs import encoded, texture, with_exif
from message_words import mentions

from styletrf.capture.capture_file import read_capture
from styletrf.capture.masks import read_mask
from styletrf.capture.poses.given_poses import GivenPoses, GivenView, Lens
from styletrf.capture.scene_capture import capture_photographs
from styletrf.errors import InputError
from styletrf.steps.sources.scene_capture import capture_scene
from styletrf.steps.step_run import StepRun


def photograph(seed, width=24, height=16):
    return encoded(texture(height, width, seed))


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "images"
    folder.mkdir()
    for index in (10, 9, 1):
        (folder / f"view {index}.jpg").write_bytes(photograph(index))
    return folder


def test_the_users_bytes_are_kept_exactly(folder, tmp_path):
    capture = capture_photographs(folder, tmp_path / "out")
    assert [one.name for one in capture.photographs] == ["view 1", "view 9", "view 10"]
    assert {path.name for path in (tmp_path / "out/images").iterdir()} == {
        path.name for path in folder.iterdir()
    }
    for one in capture.photographs:
        data = (tmp_path / "out/images" / one.file).read_bytes()
        assert data == (folder / one.file).read_bytes()
        assert (one.size_bytes, one.sha256) == (len(data), hashlib.sha256(data).hexdigest())
    assert not capture.warnings


def test_the_table_reads_back_and_is_the_same_every_time(folder, tmp_path):
    capture = capture_photographs(folder, tmp_path / "a")
    capture_photographs(folder, tmp_path / "b")
    assert read_capture(tmp_path / "a") == capture
    one, other = ((tmp_path / out / "capture.json").read_bytes() for out in "ab")
    assert one == other


def test_sizes_are_those_of_the_upright_photographs(folder, tmp_path):
    for path in folder.iterdir():
        path.write_bytes(with_exif(path.read_bytes(), orientation=6))
    capture = capture_photographs(folder, tmp_path / "out")
    assert {(one.width, one.height) for one in capture.photographs} == {(16, 24)}


def test_names_stay_apart_where_only_suffixes_differ(folder, tmp_path):
    (folder / "view 1.png").write_bytes(encoded(texture(16, 20), ".png"))
    names = [one.name for one in capture_photographs(folder, tmp_path / "out").photographs]
    assert names == ["view 1.jpg", "view 1.png", "view 9.jpg", "view 10.jpg"]


def test_damaged_photographs_are_left_out_by_name_where_most_are_whole(folder, tmp_path):
    (folder / "short.jpg").write_bytes(photograph(5)[:-50])
    (folder / "text.png").write_bytes(b"no image")
    capture = capture_photographs(folder, tmp_path / "out")
    assert [one.name for one in capture.photographs] == ["view 1", "view 9", "view 10"]
    assert len(capture.warnings) == 2
    assert "short.jpg" in capture.warnings[0]
    assert "text.png" in capture.warnings[1]
    assert len([*(tmp_path / "out/images").iterdir()]) == 3


@pytest.mark.parametrize("damaged", [1, 4])
def test_all_damaged_photographs_are_named_where_too_few_are_whole(folder, tmp_path, damaged):
    whole = sorted(folder.iterdir())
    if damaged == 1:  # two of three are whole, and three are needed
        whole[0].write_bytes(b"")
    for index in range(damaged - 1 if damaged == 1 else damaged):
        (folder / f"damaged {index}.jpg").write_bytes(b"")
    with pytest.raises(InputError) as refusal:
        capture_photographs(folder, tmp_path / "out")
    assert all(
        path.name in refusal.value.problem for path in folder.iterdir() if not path.read_bytes()
    )
    assert not (tmp_path / "out").exists()


def test_photographs_of_several_sizes_are_one_capture(folder, tmp_path):
    (folder / "tall.jpg").write_bytes(photograph(6, 16, 24))
    capture = capture_photographs(folder, tmp_path / "out")
    sizes = {one.name: (one.width, one.height) for one in capture.photographs}
    assert sizes["tall"] == (16, 24)
    assert sizes["view 1"] == (24, 16)
    assert not capture.warnings


def test_photographs_lie_in_folders_in_folders(folder, tmp_path):
    files = ["second/walk/view 1.jpg", "masks/view 1.jpg", "images_4/view 1.jpg", ".trash/x.jpg"]
    for index, name in enumerate(files):
        (folder / name).parent.mkdir(parents=True)
        (folder / name).write_bytes(photograph(20 + index))
    capture = capture_photographs(folder, tmp_path / "out")
    assert sorted(one.name for one in capture.photographs) == [
        "second_walk_view 1", "view 1", "view 10", "view 9",
    ]  # fmt: skip


def test_what_is_named_is_left_out(folder, tmp_path):
    for index in range(2, 6):
        (folder / f"view {index}.jpg").write_bytes(photograph(index))
    capture = capture_photographs(folder, tmp_path / "out", leave_out=["view 1*", "view 3.jpg"])
    names = [one.name for one in capture.photographs]
    assert names == ["view 2", "view 4", "view 5", "view 9"]


def test_a_name_to_leave_out_that_is_none_is_refused(folder, tmp_path):
    with rejects("viwe 1"):
        capture_photographs(folder, tmp_path / "out", leave_out=["viwe 1"])


def test_a_long_list_of_files_in_a_warning_is_cut_and_the_rest_counted(folder, tmp_path):
    for index in range(13):
        (folder / f"raw{index}.nef").touch()
    (warning,) = capture_photographs(folder, tmp_path / "out").warnings
    assert re.search(r"raw0.nef.* and \d+ more", warning)


def test_one_shot_in_two_files_is_one_photograph(folder, tmp_path):
    """One of the two could be held out, and would flatter the field fitted to the other."""
    (folder / "view 9 copy.jpg").write_bytes((folder / "view 9.jpg").read_bytes())
    (folder / "view 10.png").write_bytes(encoded(texture(16, 24), ".png"))
    capture = capture_photographs(folder, tmp_path / "out")
    names = [one.file for one in capture.photographs]
    assert names == ["view 1.jpg", "view 9 copy.jpg", "view 10.jpg"]
    (warning,) = capture.warnings
    assert mentions(warning, "view 9.jpg", "view 10.png")


def test_of_one_shot_in_two_files_the_masked_one_is_used(folder, tmp_path):
    (folder / "view 10.png").write_bytes(encoded(texture(16, 24), ".png"))
    mask = np.full((16, 24), 255, np.uint8)
    mask[:4] = 0
    with_mask(folder, mask, "view 10.png.png")
    capture = capture_photographs(folder, tmp_path / "out")
    assert "view 10.png" in [one.file for one in capture.photographs]
    assert len(list((tmp_path / "out/masks").iterdir())) == 1


def test_files_of_one_name_in_different_case_are_two_photographs(folder, tmp_path):
    (folder / "VIEW 1.jpg").write_bytes(photograph(3))
    assert len(capture_photographs(folder, tmp_path / "out").photographs) == 4


def test_files_that_are_passed_over_are_named_wherever_they_lie(folder, tmp_path):
    for name in ("raw.NEF", "card/raw.dng", "still.gif", "walk.mp4", "view 9.mov"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).touch()
    converted, clips = capture_photographs(folder, tmp_path / "out").warnings
    assert mentions(converted, "raw.NEF", "raw.dng", "still.gif")
    assert "walk.mp4" in clips
    assert "view 9.mov" not in clips, "a telephone stores it with each photograph"


def test_clips_beside_the_folder_of_the_photographs_are_named_as_well(folder, tmp_path):
    """The scene's own folder was not looked at."""
    scene = tmp_path / "data/scenes/walk"
    scene.mkdir(parents=True)
    folder.rename(scene / "images")
    for name in ("walk/clip.mp4", "walk.mov", "walk/images/inner.webm", "other.mp4"):
        (scene.parent / name).touch()
    out = tmp_path / "out"
    capture_scene({}, out, {}, StepRun(tmp_path), data=tmp_path / "data", scene="walk")
    (warning,) = read_capture(out).warnings
    assert mentions(warning, "clip.mp4", "walk.mov", "inner.webm")
    assert "other.mp4" not in warning


def test_photographs_in_folders_that_have_no_poses_are_named(folder, tmp_path):
    """They were left out, and nothing said so."""
    (folder / "walk").mkdir()
    (folder / "walk/view 2.jpg").write_bytes(photograph(2))
    lens = Lens("SIMPLE_PINHOLE", (20.0, 12.0, 8.0), 24, 16)
    views = tuple(GivenView(file, lens, np.eye(3, 4)) for file in sorted(folder.glob("*.jpg")))
    given = GivenPoses(tmp_path, views)
    (warning,) = capture_photographs(folder, tmp_path / "out", given=given).warnings
    assert mentions(warning, "walk/view 2.jpg")


def test_progress_counts_the_photographs(folder, tmp_path):
    calls = []
    capture_photographs(folder, tmp_path / "out", lambda done, total: calls.append((done, total)))
    assert calls == [(0, 3), (1, 3), (2, 3), (3, 3)]


def with_mask(folder, mask, name="view 1.png"):
    (folder / "masks").mkdir()
    (folder / "masks" / name).write_bytes(encoded(mask, ".png"))


@pytest.mark.parametrize("name", ["view 1.png", "view 1.jpg.png"])
def test_a_mask_is_kept_with_its_photograph(folder, tmp_path, name):
    mask = np.zeros((16, 24), np.uint8)
    mask[:, 12:] = 255
    with_mask(folder, mask, name)
    capture = capture_photographs(folder, tmp_path / "out")
    assert len(capture.photographs) == 3
    assert [path.name for path in (tmp_path / "out/masks").iterdir()] == ["view 1.png"]
    assert (read_mask(tmp_path / "out/masks/view 1.png") == (mask > 0)).all()


@pytest.mark.parametrize("color", [0, 255])
def test_transparent_parts_of_a_mask_do_not_count_whatever_color_they_hide(tmp_path, color):
    layer = np.full((16, 24, 4), color, np.uint8)
    layer[..., 3] = 0
    layer[4:8] = 255
    (tmp_path / "mask.png").write_bytes(encoded(layer, ".png"))
    assert (read_mask(tmp_path / "mask.png") == (layer[..., 3] > 0)).all()


@pytest.mark.parametrize(
    ("mask", "values", "advice"),
    [
        (np.full((16, 24, 4), [255, 255, 255, 0], np.uint8), ["transparent"], "white layer"),
        (np.full((16, 24, 4), [0, 0, 0, 128], np.uint8), ["transparent"], "white layer"),
        (np.full((16, 24, 4), [90, 90, 90, 255], np.uint8), ["black"], " 90"),
        (np.zeros((16, 24), np.uint8), ["black"], ""),
        (np.ones((16, 24), np.uint8), ["black"], " 1"),
        (np.full((8, 8), 255, np.uint8), ["8x8", "24x16"], ""),
    ],
)
def test_what_is_no_mask_of_its_photograph_is_refused(folder, tmp_path, mask, values, advice):
    with_mask(folder, mask)
    with rejects("mask", *values) as refusal:
        capture_photographs(folder, tmp_path / "out")
    assert advice in refusal.value.remedy
    assert not (tmp_path / "out").exists()


def test_every_photograph_is_kept_whatever_its_folder_is_called(folder, tmp_path):
    for index, name in enumerate(["a/1_1.jpg", "a_1/1.jpg", "b/1.jpg"]):
        (folder / name).parent.mkdir()
        (folder / name).write_bytes(photograph(20 + index))
    capture = capture_photographs(folder, tmp_path / "out")
    assert len([*(tmp_path / "out/images").iterdir()]) == len(capture.photographs) == 6
    for one in capture.photographs:
        data = (tmp_path / "out/images" / one.file).read_bytes()
        assert hashlib.sha256(data).hexdigest() == one.sha256


def test_masks_that_fit_no_photograph_are_named_and_those_of_photographs_left_out_are_not(
    folder, tmp_path
):
    """A mask with a name that missed was ignored, and nothing said so."""
    (folder / "view 2.jpg").write_bytes(photograph(2))
    for name in ("VIEW 1.png", "view 2.png", "walk/view 9.jpeg"):
        mask = tmp_path / "masks" / name
        mask.parent.mkdir(parents=True, exist_ok=True)
        mask.write_bytes(encoded(np.full((16, 24), 255, np.uint8), ".png"))
    (warning,) = capture_photographs(folder, tmp_path / "out", leave_out=["view 2"]).warnings
    assert mentions(warning, "masks/VIEW 1.png", "masks/walk/view 9.jpeg")
    assert "view 2" not in warning
