"""Frames of a video: what a camera that walks, turns or rests shows, and which are taken."""

import cv2
import numpy as np
import pytest
from clip_frames import HEIGHT, WIDTH, timed, walked
from expected_errors import rejects

from styletrf.capture.clips.frame_choice import chosen_frames
from styletrf.capture.clips.frame_flow import flow_between, flow_of
from styletrf.capture.clips.frame_motion import FrameMotion, frame_motion, joined_motion


@pytest.fixture(scope="module")
def picture():
    """A wall of texture, twice as wide as a frame."""
    noise = np.random.default_rng(0).uniform(0, 255, (HEIGHT, 2 * WIDTH, 3))
    return cv2.GaussianBlur(noise, (0, 0), 2.0)


def motion_of(frames):
    return frame_motion(timed(frames))


def test_frames_stand_an_even_travel_apart_and_a_rest_has_none_of_its_own(picture):
    walk = walked(picture, 40)
    frames = walk[:20] + [walk[20]] * 40 + walk[20:]
    chosen = chosen_frames(motion_of(frames), 10)
    resting = (chosen > 20) & (chosen < 60)
    assert resting.sum() <= 1
    moving = np.where(chosen >= 60, chosen - 40, chosen)[~resting]
    assert np.diff(moving).max() <= 2 * np.diff(moving).mean()


def test_of_the_frames_about_a_step_the_sharpest_is_taken(picture):
    frames = walked(picture, 41)
    sharp = {0, 9, 10, 20, 30, 31, 40}
    blurred = [f if k in sharp else cv2.GaussianBlur(f, (0, 0), 2.0) for k, f in enumerate(frames)]
    assert set(chosen_frames(motion_of(blurred), 5).tolist()) <= sharp


@pytest.fixture(scope="module")
def walk_of_40(picture):
    return motion_of(walked(picture, 40))


@pytest.mark.parametrize("count", [1, 2, 7, 40, 500])
def test_never_more_than_asked_for_each_once_and_in_order(walk_of_40, count):
    chosen = chosen_frames(walk_of_40, count)
    assert 1 <= len(chosen) <= min(count, 40)
    assert (np.diff(chosen) > 0).all()


def test_a_camera_that_rests_is_refused(picture):
    with rejects("the video", "2%"):
        chosen_frames(motion_of([walked(picture, 1)[0]] * 30), 10)


@pytest.mark.parametrize("value", [0, 128, 255])
def test_frames_without_texture_are_refused(value):
    with rejects("the video", "2%"):
        chosen_frames(motion_of([np.full((48, 64, 3), value, np.uint8)] * 5), 3)


def test_no_frames_at_all_are_refused():
    nothing, no_flow = np.zeros(0), flow_of(np.zeros((0, 7)))
    with rejects("the video", "2%"):
        chosen_frames(FrameMotion(*[nothing] * 4, np.zeros(0, np.int64), no_flow), 3)


def test_clips_share_the_frames_by_how_far_they_go(picture):
    """One walks three times as far as the other, a third keeps still for longer than both."""
    walk = walked(picture, 52)
    clips = [walk[:13], [walk[20]] * 60, walk[13:]]
    chosen = chosen_frames(joined_motion([motion_of(clip) for clip in clips]), 21)
    near, still, far = np.histogram(chosen, [0, 13, 73, 112])[0]
    assert near + far >= 20
    assert still <= 1
    assert 2 < far / near < 4


@pytest.mark.parametrize("height", [1, 12, 20, 31])
def test_frames_more_than_five_times_as_wide_as_high_have_no_flow(height):
    """OpenCV crashed the process."""
    one, other = np.random.default_rng(0).integers(0, 256, (2, height, 160), dtype=np.uint8)
    assert not flow_between(one, other).any()
