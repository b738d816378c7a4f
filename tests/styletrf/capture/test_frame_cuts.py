"""Where a clip is cut, also within one place, and what looks like a cut and is none."""

from itertools import chain

import numpy as np
import pytest
from clip_frames import HEIGHT, WIDTH, timed, turned, walked, wall

from styletrf.capture.clips.frame_motion import frame_motion, joined_motion


def cuts_of(frames, rate=12.0):
    return frame_motion(timed(frames, rate)).cuts_s


def lit(frame, light):
    return np.clip(frame * light, 0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("frames_before", "rate"), [(3, 60.0), (3, 6.0), (12, 12.0), (21, 6.0), (21, 60.0)]
)
def test_a_cut_within_one_place_is_where_it_is(rate, frames_before):
    """The colors stay; the camera only goes on elsewhere."""
    walk = walked(wall(0, width=4 * WIDTH), 24)
    elsewhere = walked(wall(0, width=4 * WIDTH)[:, WIDTH:], 24)
    found = cuts_of([*walk[:frames_before], *elsewhere[frames_before:]], rate)
    assert found == pytest.approx([frames_before / rate], abs=1e-6)


def test_every_one_of_several_cuts_is_found():
    clips = [turned(wall(seed), 15) for seed in range(4)]
    assert cuts_of([*chain(*clips)]) == pytest.approx([15 / 12, 30 / 12, 45 / 12])


def test_nothing_moves_across_a_cut():
    parts = walked(wall(0), 12), walked(wall(1), 12)
    whole = frame_motion(timed([*parts[0], *parts[1]]))
    apart = joined_motion([frame_motion(timed(part)) for part in parts])
    np.testing.assert_array_equal(whole.shot, apart.shot)
    np.testing.assert_allclose(whole.displacement, apart.displacement, atol=1e-9)


@pytest.mark.parametrize("frames", [walked(wall(0), 30), turned(wall(0), 30)])
def test_a_camera_that_goes_on_is_no_cut(frames):
    assert cuts_of(frames) == []


@pytest.mark.parametrize(
    "light",
    [
        pytest.param(np.linspace(1, 0, 20), id="fade to black"),
        pytest.param(np.linspace(0, 1, 20), id="fade from black"),
        pytest.param(np.repeat([1.0, 0.6], 10), id="darker at once"),
        pytest.param(np.repeat([0.6, 1.0], 10), id="brighter at once"),
        pytest.param(np.where(np.arange(20) == 10, 6.0, 1.0), id="flash"),
    ],
)
def test_other_light_is_no_cut(light):
    frames = walked(wall(0), 30)
    lights = [*np.full(5, light[0]), *light, *np.full(5, light[-1])]
    assert cuts_of([lit(*pair) for pair in zip(frames, lights, strict=True)]) == []


def test_a_lamp_at_one_side_is_no_cut():
    frames = walked(wall(0), 20)
    lamp = np.linspace(0.4, 1.2, WIDTH)[None, :, None] * np.ones((HEIGHT, 1, 1))
    assert cuts_of([*frames[:10], *[lit(frame, lamp) for frame in frames[10:]]]) == []


def test_slides_have_no_cuts_since_nothing_goes_on_between_them():
    assert cuts_of([turned(wall(seed), 1)[0] for seed in range(12)]) == []
