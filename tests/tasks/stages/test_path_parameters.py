"""The number of frames of a path, by its length, its rate and the times in its file."""

import json
import os

import pytest
from expected_errors import rejects
from stage_keys import WORDS

import tasks
from tasks.planning.stage_demands import demand_of
from tasks.planning.stage_drivers import drivers_of
from tasks.stages.path_parameters import frame_count


@pytest.mark.parametrize(
    ("words", "frames"),
    [
        ({}, 60), ({"seconds": 2.0}, 48), ({"seconds": 2.0, "frame_rate": 60}, 120),
        ({"seconds": 2.0, "tuning": {"TrajectoryFrames": {"trajectory.speed": 2.0}}}, 24),
        ({"settings": {"trajectory.frames": "many"}}, None),
        ({"settings": {"frames_per_second": 23.5}}, None),
    ],
)  # fmt: skip
def test_the_number_of_frames_is_known_before_any_is_made(words, frames):
    stage = tasks.TrajectoryFrames(scene="s", quality="draft", **words)
    assert frame_count(stage.values()) == frames


@pytest.mark.parametrize(
    ("frames", "deltas", "is_refused"),
    [(1, None, True), (2, None, False), (5, [5], True), (6, [5, 7], False), (3, "no list", False)],
)
def test_a_path_without_two_frames_to_compare_is_refused(frames, deltas, is_refused):
    """Before anything is built, not after everything was."""
    tuning = {"TrajectoryFrames": {"trajectory.frames": frames}}
    tuning |= {"ConsistencyMetrics": {"deltas": deltas}} if deltas else {}
    stage = tasks.ConsistencyMetrics(scene="s", style="p", tuning=tuning)
    if not is_refused:
        stage.validate()
        return
    with rejects("trajectory.frames"):
        stage.validate()


def write_path(file, *times):
    entries = [{"photograph": "a", **({} if t is None else {"time_s": t})} for t in times]
    file.write_text(json.dumps({"key_frames": entries}))


@pytest.mark.parametrize(
    ("words", "frames"),
    [({}, 14401), ({"seconds": 2.0}, 48), ({"frame_rate": 60}, 36001)],
)
def test_a_path_with_times_of_its_own_has_the_frames_of_its_duration(tmp_path, words, frames):
    """It counted as the frames of the preset, and no disk was too small."""
    write_path(file := tmp_path / "p.json", 0, 600)
    stage = tasks.StylizedFrames(path=str(file), **WORDS, **words)
    assert demand_of(stage).frames == frames
    assert drivers_of(stage, {})["frames"] == frames
    few = {"TrajectoryFrames": {"trajectory.frames": 1}}
    tasks.ConsistencyMetrics(path=str(file), tuning=few, **WORDS, **words).validate()


def test_a_path_without_times_or_that_is_none_has_the_frames_of_the_settings(tmp_path):
    write_path(file := tmp_path / "p.json", None, None)
    (tmp_path / "list.json").write_text("[1]")
    for path in (file, tmp_path / "list.json", tmp_path / "missing.json", tmp_path):
        stage = tasks.TrajectoryFrames(scene="s", path=str(path), quality="draft")
        assert demand_of(stage).frames == frame_count(stage.values()) == 60


def test_a_path_that_changed_is_read_again(tmp_path):
    write_path(file := tmp_path / "p.json", 0, 1)
    stage = tasks.TrajectoryFrames(scene="s", path=str(file))
    assert stage.path_seconds == 1
    write_path(file, 0, 2)
    os.utime(file, ns=(0, file.stat().st_mtime_ns + 1))
    assert stage.path_seconds == 2
