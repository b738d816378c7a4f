"""Frames that lean since their rows are exposed one after another, and those that do not."""

import numpy as np
import pytest
from clip_frames import WIDTH, panned, timed, walked, wall

from styletrf.capture.clips.frame_motion import frame_motion
from styletrf.capture.clips.rolling_shutter import rolling_shutter

COUNT = 60
PAINTED = wall(3, width=4 * WIDTH)


def by_hand(t):
    """Columns that a hand-held pan has passed after t frames: about two a frame."""
    return 40 + 2 * t + 8 * np.sin(t / 3.1) + 5 * np.sin(t / 1.7 + 1)


def steadily(t):
    return 40 + 3 * np.asarray(t, dtype=np.float64)


def shutter_of(frames):
    return rolling_shutter(frame_motion(timed(frames, 24.0)))


@pytest.mark.parametrize("fraction", [0.4, 0.8, -0.6])
def test_a_pan_by_hand_whose_rows_are_exposed_in_turn_leans(fraction):
    """A negative share is that of a camera held upside down."""
    found = shutter_of(panned(PAINTED, by_hand, COUNT, fraction))
    assert found.fraction == pytest.approx(abs(fraction), rel=0.3)
    assert found.correlation > 0.8
    t = np.arange(COUNT)
    lean = abs(fraction) * np.abs(by_hand(t + 1) - by_hand(t)) / WIDTH
    assert found.lean == pytest.approx(np.quantile(lean, 0.75), rel=0.3)


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_rolling_shutter_is_found_however_the_camera_was_held(turns):
    frames = panned(PAINTED, by_hand, COUNT, 0.6)
    assert shutter_of([np.ascontiguousarray(np.rot90(frame, turns)) for frame in frames])


@pytest.mark.parametrize("way", [by_hand, steadily])
def test_a_pan_whose_rows_are_exposed_at_once_shows_no_rolling_shutter(way):
    assert shutter_of(panned(PAINTED, way, COUNT)) is None


def test_a_walk_past_near_and_far_walls_shows_no_rolling_shutter():
    """The halves of the picture move apart, at any time in proportion to the speed."""
    walk = walked(wall(4, width=5 * WIDTH), 160)
    columns = (by_hand(np.arange(COUNT)) - 40).astype(int)
    assert shutter_of([walk[x] for x in np.clip(columns, 0, 159)]) is None


def test_a_lean_that_the_mapper_does_not_notice_is_not_told():
    def slowly(t):
        return 40 + (by_hand(t) - 40) / 20

    assert shutter_of(panned(PAINTED, slowly, COUNT, 0.5)) is None


@pytest.mark.parametrize("count", [1, 2, 3, 20])
def test_short_clips_tell_no_rolling_shutter(count):
    assert shutter_of(panned(PAINTED, by_hand, count, 0.8)) is None
