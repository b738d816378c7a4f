import json

import numpy as np
import pytest
from made_panoramas import courtyard_panoramas
from made_photographs import encoded, texture

from styletrf.capture.expected_names import expected_names
from styletrf.capture.panorama.panorama_views import DIRECTIONS
from styletrf.capture.poses.pose_formats import find_given_poses
from styletrf.capture.scene_capture import CaptureConfig, capture_photographs
from styletrf.capture.user_folders import scene_folder

WIDTH = 128


@pytest.fixture(scope="module")
def panoramas():
    return [encoded(image, ".png") for image in courtyard_panoramas(4, WIDTH)[1][:3]]


def plain(seed):
    return encoded(texture(32, 48, seed), ".png")


def two_folders(folder, panoramas):
    for index, name in enumerate(["a/1.png", "b/1.png", "a/2.png", "a/2.jpg", "a_2.png"]):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(plain(index))


def mixed(folder, panoramas):
    for index, image in enumerate(panoramas):
        (folder / f"p{index}.png").write_bytes(image)
    for index in range(3):
        (folder / f"view{index}.png").write_bytes(plain(index))


def all_panoramas(folder, panoramas):
    for index, image in enumerate(panoramas):
        (folder / f"p{index}.png").write_bytes(image)


def damaged(folder, panoramas):
    mixed(folder, panoramas)
    (folder / "p1.png").write_bytes(panoramas[1][:-60])
    (folder / "view1.png").write_bytes(b"")


def masked(folder, panoramas):
    mixed(folder, panoramas)
    (folder / "masks").mkdir()
    (folder / "masks/person.png").write_bytes(plain(8))


def posed(folder, panoramas):
    mixed(folder, panoramas)
    names = ["p0.png", "view0.png", "view1.png"]
    frames = [{"file_path": name, "transform_matrix": np.eye(4).tolist()} for name in names]
    lens = {"camera_angle_x": 1.0, "w": 48, "h": 32}
    (folder / "transforms.json").write_text(json.dumps({"frames": frames, **lens}))


CASES = [
    (two_folders, CaptureConfig()),
    (mixed, CaptureConfig()),
    (mixed, CaptureConfig(panoramas="no")),
    (mixed, CaptureConfig(leave_out=("p1", "view2"))),
    (all_panoramas, CaptureConfig(panoramas="yes")),
    (damaged, CaptureConfig()),
    (masked, CaptureConfig()),
    (posed, CaptureConfig()),
]


@pytest.mark.parametrize(
    ("fill", "config"), CASES, ids=[f"{fill.__name__}-{k}" for k, (fill, _) in enumerate(CASES)]
)
def test_a_name_is_expected_if_and_only_if_the_capture_gives_it(fill, config, panoramas, tmp_path):
    (folder := tmp_path / "scene").mkdir()
    fill(folder, panoramas)
    given = find_given_poses(scene_folder(folder))
    settings = {"leave_out": config.leave_out, "panoramas": config.panoramas}
    capture = capture_photographs(folder, tmp_path / "out", given=given, **settings)
    captured = {photograph.name for photograph in capture.photographs}
    plain_names = {path.stem for path in folder.rglob("*.*")} | captured
    views = {f"{name}_{direction}" for name in plain_names for direction in DIRECTIONS[::4]}
    for name in plain_names | views:
        expected = expected_names(folder, config, {name})
        assert expected.poses_are_given == (given is not None)
        assert (name in expected.names) == (name in captured), name


def expected_of_frames(tmp_path, clips, **config):
    for clip in clips:
        (tmp_path / clip).touch()
    found = tmp_path / clips[0] if len(clips) == 1 else tmp_path
    return set(expected_names(found, CaptureConfig(**config), set()).names)


@pytest.mark.parametrize("panoramas", ["no", "yes", "auto"])
def test_frames_of_a_clip_are_expected_up_to_their_number(tmp_path, panoramas):
    names = expected_of_frames(
        tmp_path, ["walk.mp4"], video_frames=7, leave_out=("0003",), panoramas=panoramas
    )
    frames = {"0001", "0002", "0004", "0005", "0006", "0007"}
    views = {f"{frame}_{direction}" for frame in frames for direction in DIRECTIONS}
    assert names == {"no": frames, "yes": views, "auto": frames | views}[panoramas]


def test_frames_of_several_clips_are_expected_with_the_names_of_their_clips(tmp_path):
    names = expected_of_frames(tmp_path, ["a.mp4", "b.mp4"], video_frames=3, panoramas="no")
    assert names == {f"{clip}_000{number}" for clip in "ab" for number in (1, 2, 3)}
