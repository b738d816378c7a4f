"""Rests of a clip, and what the capture says of it."""

import re

import numpy as np
import pytest
from clip_frames import WIDTH, panned, timed, turned, walked, wall
from message_words import mentions

from styletrf.capture.capture_file import read_capture
from styletrf.capture.clips.clip_survey import clip_warnings
from styletrf.capture.clips.frame_choice import chosen_frames
from styletrf.capture.clips.frame_motion import frame_motion
from styletrf.capture.clips.spans import rests
from styletrf.capture.clips.video_capture import capture_videos
from styletrf.files.video import write_video

PAINTED = wall(3, width=4 * WIDTH)


def rests_of(frames, rate):
    return rests(frame_motion(timed(frames, rate)))


def with_a_rest(frames, at, count):
    """The frames, of which one is shown so many times more."""
    return [*frames[:at], *[frames[at]] * count, *frames[at:]]


@pytest.mark.parametrize("rate", [8, 12, 30])
@pytest.mark.parametrize("moving", [walked, turned])
def test_a_still_second_has_its_times_within_a_frame(moving, rate):
    frames = with_a_rest(moving(wall(0), 40), 20, rate)
    (rest,) = rests_of(frames, rate)
    assert rest.start_s == pytest.approx(20 / rate, abs=1.01 / rate)
    assert rest.end_s == pytest.approx(20 / rate + 1, abs=1.01 / rate)


def test_two_rests_of_a_walk_are_found_apart():
    frames = with_a_rest(with_a_rest(walked(wall(0), 45), 30, 15), 15, 15)
    assert len(rests_of(frames, 12)) == 2


@pytest.mark.parametrize("pixels_a_frame", [0.3, 1.0, 4.0])
@pytest.mark.parametrize("rate", [6, 24])
def test_a_smooth_pan_has_no_rest_however_slow(pixels_a_frame, rate):
    frames = panned(PAINTED, lambda t: pixels_a_frame * t, 40)
    assert rests_of(frames, rate) == []


def test_going_at_half_the_speed_is_no_rest():
    steps = np.repeat([2.0, 1.0, 2.0], 16)
    ways = np.append(0.0, np.cumsum(steps))
    frames = panned(wall(0), lambda t: np.interp(t, np.arange(len(ways)), ways), 48)
    assert rests_of(frames, 12) == []


def test_a_pause_shorter_than_a_breath_is_none():
    assert rests_of(with_a_rest(walked(wall(0), 40), 20, 6), 12) == []


def test_frames_left_out_are_those_of_the_rest_that_are_not_chosen():
    frames = with_a_rest(walked(wall(0), 40), 20, 24)
    motion = frame_motion(timed(frames, 24))
    chosen = chosen_frames(motion, 20)
    (rest,) = rests(motion)
    among = [index for index in chosen if rest.first <= index <= rest.last]
    assert rest.without(chosen) == rest.last - rest.first + 1 - len(among)
    assert rest.without(chosen) >= 22
    (warning,) = clip_warnings("a.mp4", motion, None, chosen)
    assert mentions(warning, "a.mp4", rest.without(chosen))


def test_a_video_with_a_cut_and_a_still_second_says_when(tmp_path):
    """The rest begins at 2.5 s; the cut, to another part of the wall, is at 4 s."""
    before = with_a_rest(walked(wall(0), 36), 30, 12)
    frames = [*before, *walked(wall(0)[:, WIDTH:], 30)]
    write_video(tmp_path / "a.mp4", frames, 12)
    capture = capture_videos([tmp_path / "a.mp4"], tmp_path / "out", 12)
    cut, rest = capture.warnings
    assert mentions(cut, "a.mp4", "4.0")
    assert re.search(r"a\.mp4.*\b2\.[456]\b.*\b3\.[456]\b", rest)
    assert read_capture(tmp_path / "out").warnings == capture.warnings
    shots = {photograph.shot for photograph in capture.photographs if photograph.time_s < 4}
    assert shots == {0}
    assert {one.shot for one in capture.photographs if one.time_s >= 4} == {1}


def test_a_video_by_hand_whose_frames_lean_says_so_and_a_steady_one_does_not(tmp_path):
    def by_hand(t):
        return 40 + 2 * t + 8 * np.sin(t / 3.1)

    filmed = {fraction: panned(PAINTED, by_hand, 60, fraction) for fraction in (0.8, 0.0)}
    reported = []
    for fraction, frames in filmed.items():
        write_video(tmp_path / f"{fraction}.mp4", frames, 24)
        warnings = capture_videos(
            [tmp_path / f"{fraction}.mp4"], tmp_path / str(fraction), 12
        ).warnings
        reported.append(len(warnings))
    leaning, steady = reported
    assert leaning == steady + 1
