"""What a camera that walks, turns, rests or is cut shows in its frames."""

import cv2
import numpy as np
import pytest
from clip_frames import HEIGHT, WIDTH, contrasted, timed, turned, walked, wall
from message_words import mentions

from styletrf.capture.clips.clip_survey import clip_warnings
from styletrf.capture.clips.frame_motion import frame_motion, joined_motion
from styletrf.capture.clips.spans import blurs, rests

RATE = 10.0


def motion_of(frames, rate=RATE):
    return frame_motion(timed(frames, rate))


def flat(motion):
    return np.stack([motion.displacement, motion.parallax])


def test_a_walk_has_parallax_and_a_turn_has_none():
    walk, turn = motion_of(walked(wall(0), 20)), motion_of(turned(wall(0), 20))
    assert walk.has_parallax
    assert not turn.has_parallax
    assert turn.displacement[-1] == pytest.approx(19 * 2 / WIDTH, rel=0.05)
    assert walk.cuts_s == turn.cuts_s == []


def test_a_cut_is_where_it_is_and_moves_nothing():
    parts = walked(wall(0), 10), walked(wall(1, (1.0, 0.8, 0.6)), 10)
    motion = motion_of([*parts[0], *parts[1]])
    assert motion.cuts_s == [1.0]
    apart = [motion_of(part) for part in parts]
    np.testing.assert_allclose(flat(motion), flat(joined_motion(apart)), atol=1e-9)
    np.testing.assert_array_equal(motion.shot, joined_motion(apart).shot)


def test_a_swing_is_no_cut():
    """A wall whose color changes along it, swept past at most of a width a frame."""
    noise = np.random.default_rng(2).uniform(0, 255, (HEIGHT, 12 * WIDTH, 3))
    tint = np.linspace([1.0, 0.6, 0.6], [0.6, 0.6, 1.0], 12 * WIDTH)
    long = cv2.GaussianBlur(noise, (0, 0), 2.0) * tint
    starts = np.cumsum([2] * 10 + [120] * 10 + [2] * 10)
    motion = motion_of([contrasted(long[:, x : x + WIDTH]) for x in starts])
    assert motion.cuts_s == []
    assert motion.displacement[-1] > 5


def test_the_same_scene_in_other_light_is_no_cut():
    frames = walked(wall(0), 30)
    darker = [np.rint(0.8 * frame).astype(np.uint8) for frame in frames[15:]]
    assert motion_of([*frames[:15], *darker]).cuts_s == []


def test_a_rest_is_found_from_its_beginning_to_its_end():
    """Held by a hand: the picture trembles by a pixel."""
    walk = walked(wall(0), 40)
    trembling = [np.roll(walk[20], k % 2, axis=1) for k in range(30)]
    (rest,) = rests(motion_of([*walk[:20], *trembling, *walk[20:]]))
    assert rest.start_s == pytest.approx(2.0, abs=0.5)
    assert rest.end_s == pytest.approx(5.0, abs=0.5)
    assert rests(motion_of(turned(wall(0), 40))) == []


@pytest.mark.parametrize(("blurred", "count"), [(range(20, 32), 1), (range(20, 21), 0)])
def test_blur_is_found_where_no_sharp_frame_is_near(blurred, count):
    """The camera swings, and what passes is smeared along."""
    starts = np.cumsum([6 if k in blurred else 2 for k in range(52)])
    frames = [contrasted(wall(0)[:, x : x + WIDTH]) for x in starts]
    for k in blurred:
        frames[k] = cv2.blur(frames[k], (15, 1))
    found = blurs(motion_of(frames))
    assert len(found) == count
    for span in found:
        assert span.start_s == pytest.approx(2.0, abs=0.25)
        assert span.end_s == pytest.approx(3.2, abs=0.25)


def test_a_walk_has_no_warning_and_a_file_that_breaks_off_has_one():
    motion = motion_of(walked(wall(0), 40))
    chosen = np.arange(0, 40, 5)
    assert list(clip_warnings("a.mp4", motion, 4.0, chosen)) == []
    assert list(clip_warnings("a.mp4", motion, None, chosen)) == []
    (warning,) = clip_warnings("a.mp4", motion, 9.0, chosen)
    assert mentions(warning, "a.mp4", "4.0", "9.0")


def test_frames_larger_than_those_looked_at_move_alike_in_widths():
    frames = turned(wall(0), 20)
    large = [cv2.resize(frame, None, fx=4, fy=4, interpolation=cv2.INTER_CUBIC) for frame in frames]
    small, same = motion_of(frames).flow, motion_of(large).flow
    np.testing.assert_allclose(same.shift[1:, 0], -2 / WIDTH, atol=0.1 / WIDTH)
    np.testing.assert_allclose(same.shift, small.shift, atol=0.1 / WIDTH)
    assert same.novelty.max() < 0.2
