"""Key frames in files: what is written is read, and a mistake is named with file, entry, remedy."""

import errno
import json
import os
from pathlib import Path

import numpy as np
import pytest
from expected_errors import rejects
from hypothesis import given, settings
from hypothesis import strategies as st

from styletrf.errors import InputError
from styletrf.geometry.cameras import Camera
from styletrf.trajectory import path_files
from styletrf.trajectory.camera_curve import Poses
from styletrf.trajectory.camera_path import frames_along, timed
from styletrf.trajectory.key_frames import (
    WIDEST_FOV_DEG,
    KeyFrame,
    KeyFrames,
    key_frames_of,
    seconds_of_file,
    write_key_frames,
)
from styletrf.trajectory.path_files import read_path
from styletrf.trajectory.trajectory_config import TrajectoryConfig

NUMBERS = st.floats(-1e6, 1e6)
POINTS = st.tuples(NUMBERS, NUMBERS, NUMBERS)
QUATERNIONS = st.tuples(st.floats(0.1, 1), NUMBERS, NUMBERS, NUMBERS)
FOVS = st.none() | st.floats(1, WIDEST_FOV_DEG)
PLACES = st.one_of(
    st.tuples(st.text(min_size=1), st.none(), st.none(), st.none(), FOVS),
    st.tuples(st.just(""), POINTS, QUATERNIONS, st.none(), FOVS),
    st.tuples(st.just(""), POINTS, st.none(), POINTS, FOVS).filter(
        lambda place: place[1] != place[3]
    ),
)


@settings(deadline=None)
@given(st.lists(PLACES, min_size=1, max_size=5), st.booleans(), st.floats(0, 1))
def test_key_frames_that_are_written_are_read_as_they_were(
    tmp_path_factory, places, closed, easing
):
    path = tmp_path_factory.mktemp("path") / "path.json"
    keys = KeyFrames(str(path), tuple(KeyFrame(*place) for place in places), closed, easing)
    write_key_frames(path, keys)
    assert read_path(path) == keys


def test_times_are_written_and_read(tmp_path):
    frames = tuple(KeyFrame(photograph=f"{k}", time_s=0.1 * k**2) for k in range(4))
    keys = KeyFrames(str(tmp_path / "p.json"), frames)
    write_key_frames(tmp_path / "p.json", keys)
    assert read_path(tmp_path / "p.json") == keys


PLACE = {"position": [0, 0, 0], "look_at": [0, 0, 1]}
MISTAKES = {
    "no key frames": ({"key_frames": []}, "no key frames"),
    "no list": ({"key_frames": 3}, "key_frames is 3, not a list"),
    "no object": ({"key_frames": ["a"]}, 'key_frames[0] is "a", not an object'),
    "unknown word": ({"key_frames": [PLACE], "loop": True}, "the file has 'loop'"),
    "unknown entry": ({"key_frames": [PLACE, PLACE | {"fov": 3}]}, "key_frames[1] has 'fov'"),
    "no place": ({"key_frames": [{}]}, "key_frames[0] is no place"),
    "no direction": ({"key_frames": [{"position": [0, 0, 0]}]}, "key_frames[0] is no place"),
    "two places": ({"key_frames": [PLACE | {"photograph": "a"}]}, "one of them is enough"),
    "two directions": (
        {"key_frames": [PLACE | {"orientation": [1, 0, 0, 0]}]},
        "key_frames[0] is no place",
    ),
    "no point": ({"key_frames": [PLACE | {"position": [0, 0]}]}, "not 3 finite numbers"),
    "not finite": ({"key_frames": [PLACE | {"look_at": [0, 0, float("nan")]}]}, "not 3 finite"),
    "huge": ({"key_frames": [PLACE | {"look_at": [0, 0, 10**400]}]}, "not 3 finite numbers"),
    "no rotation": (
        {"key_frames": [{"position": [0, 0, 0], "orientation": [0, 0, 0, 0]}]},
        "key_frames[0].orientation is zero",
    ),
    "at itself": (
        {"key_frames": [{"position": [0, 1, 2], "look_at": [0, 1, 2]}]},
        "key_frames[0].look_at is the position",
    ),
    "too wide": ({"key_frames": [PLACE | {"fov_deg": 180}]}, "not a number from 1 to 170"),
    "truth": ({"key_frames": [PLACE | {"fov_deg": True}]}, "not a number from 1 to 170"),
    "before": ({"key_frames": [PLACE | {"time_s": -1}]}, "not a number from 0 to 600"),
    "milliseconds": (
        {"key_frames": [PLACE | {"time_s": 0}, PLACE | {"time_s": 4000}]},
        "key_frames[1].time_s is 4000, not a number from 0 to 600",
    ),
    "some times": ({"key_frames": [PLACE | {"time_s": 0}, PLACE]}, "key_frames[1] has no time_s"),
    "no order": (
        {"key_frames": [PLACE | {"time_s": 1}, PLACE | {"time_s": 1}]},
        "key_frames[1].time_s 1 is not after the one before",
    ),
    "closed times": ({"key_frames": [PLACE | {"time_s": 1}], "closed": True}, "when it returns"),
    "eased times": (
        {"key_frames": [PLACE | {"time_s": 0}, PLACE | {"time_s": 1}], "easing": 0.2},
        "has easing and times",
    ),
    "no truth": ({"key_frames": [PLACE], "closed": "yes"}, 'closed is "yes", not true or false'),
    "much easing": ({"key_frames": [PLACE], "easing": 2}, "easing is 2, not a number from 0 to 1"),
}


@pytest.mark.parametrize(("values", "problem"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_named_with_the_file_and_the_entry(tmp_path, values, problem):
    path = tmp_path / "path.json"
    path.write_text(json.dumps(values))
    with pytest.raises(InputError) as error:
        read_path(path)
    assert error.value.subject == str(path)
    assert problem in error.value.problem
    assert error.value.remedy


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("", "JSON"),
        ("[1", "JSON"),
        ("[" * 100_000, "JSON"),
        ("[]", "transforms.json"),
        ("{}", "transforms.json"),
    ],
    ids=["nothing", "no end", "deep", "a list", "an object"],
)
def test_a_file_of_something_else_is_refused(tmp_path, text, value):
    (tmp_path / "path.json").write_text(text)
    with rejects(tmp_path / "path.json", value):
        read_path(tmp_path / "path.json")


def test_a_file_that_is_missing_is_answered_with_what_there_is(tmp_path):
    with rejects(f"--path {tmp_path / 'path.json'}", os.strerror(errno.ENOENT)) as error:
        read_path(tmp_path / "path.json")
    assert "photographs" in error.value.remedy


def test_a_file_that_cannot_be_read_is_refused_with_the_reason(tmp_path):
    """It was said to be missing."""
    (tmp_path / "path.json").symlink_to(tmp_path / "path.json")
    with rejects(f"--path {tmp_path / 'path.json'}", os.strerror(errno.ELOOP)):
        read_path(tmp_path / "path.json")


def test_easing_may_be_left_out():
    assert key_frames_of(Path("p"), {"key_frames": [PLACE]}).easing == 0


def test_an_animation_that_is_too_long_is_refused(tmp_path, monkeypatch):
    assert path_files.LONGEST_S == 600
    monkeypatch.setattr(path_files, "LONGEST_S", 3.0)  # ten minutes of frames take seconds to read
    frame = {"file_path": "0", "transform_matrix": np.eye(4).tolist()}
    longest, too_long = (tmp_path / f"{name}.json" for name in ("longest", "too_long"))
    for path, frames in ((longest, 3 * 24 + 1), (too_long, 3 * 24 + 2)):
        path.write_text(json.dumps({"camera_angle_x": 0.8, "frames": [frame] * frames}))
    assert len(read_path(longest).frames) == 3 * 24 + 1
    with rejects(too_long, 3):
        read_path(too_long)


@pytest.mark.parametrize("times", [(0.0, 3.0), (1.5, 2.0, 4.0), (2.0,), (None, None)], ids=str)
@pytest.mark.parametrize("words", [{}, {"speed": 2.0}, {"seconds": 1.0}], ids=str)
def test_the_frames_of_a_path_are_counted_by_its_file_alone(tmp_path, times, words):
    """Plans and refusals count them before the path is known."""
    config, file = TrajectoryConfig(**words), tmp_path / "path.json"
    keys = KeyFrames(str(file), tuple(KeyFrame(f"{k}", time_s=t) for k, t in enumerate(times)))
    write_key_frames(file, keys)
    centers = np.arange(3.0 * len(times)).reshape(-1, 3)
    poses = Poses(centers, np.eye(4)[[0] * len(times)], np.ones(len(times)))
    photograph = Camera("c", 64, 48, 50.0, 50.0, 32.0, 24.0, np.eye(3, 4))
    frames = frames_along(timed(read_path(file), poses), photograph, config, 24)
    assert len(frames) == config.count(24, seconds_of_file(file))
    assert seconds_of_file(file) == read_path(file).seconds == keys.seconds


@pytest.mark.parametrize("text", ["", "[1]", "3", '{"frames": 3}', '{"frames": []}', "{}"])
def test_what_is_no_path_has_no_duration(tmp_path, text):
    (tmp_path / "path.json").write_text(text)
    for file in (tmp_path / "path.json", tmp_path / "missing.json", tmp_path):
        assert seconds_of_file(file) == 0
