import math
from dataclasses import astuple

import cv2
import numpy as np
import pytest

from styletrf.consistency import measure_consistency
from styletrf.errors import InputError
from styletrf.float_images import write_float_image
from styletrf.images import write_rgb

FRAMES, HEIGHT, WIDTH = 8, 72, 96
STEP = 2  # pixels a frame


def texture(seed, width=WIDTH + STEP * FRAMES):
    noise = np.random.default_rng(seed).random((HEIGHT, width, 3)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 2)
    return (smooth - smooth.min()) / (smooth.max() - smooth.min())


def pan(painting):
    return [painting[:, STEP * i : STEP * i + WIDTH] for i in range(FRAMES)]


def flickering(frames, sigma, seed=0):
    random = np.random.default_rng(seed)
    return [frame + random.normal(0, sigma, frame.shape).astype(np.float32) for frame in frames]


def measure(unstylized, stylized, **options):
    return measure_consistency(unstylized, stylized, **options)


def test_a_pan_over_one_painting_is_consistent():
    result = measure(pan(texture(0)), pan(texture(1)))
    variance = float(texture(1).var())
    for delta in ("delta_1", "delta_5"):
        assert result.summary[delta]["masked_error"] < 0.01 * variance
        assert result.summary[delta]["masked_floor"] < 0.01 * variance
        assert result.summary[delta]["valid_fraction"] > 0.7


def test_a_painting_that_stays_on_the_screen_is_inconsistent():
    still = measure(pan(texture(0)), [pan(texture(1))[0]] * FRAMES)
    moving = measure(pan(texture(0)), pan(texture(1)))
    for delta in ("delta_1", "delta_5"):
        assert still.summary[delta]["error"] > 5 * moving.summary[delta]["error"]
        assert still.summary[delta]["floor"] == moving.summary[delta]["floor"]


@pytest.mark.parametrize("sigma", [0.02, 0.1])
def test_flicker_is_measured_as_twice_its_variance(sigma):
    still = [pan(texture(0))[0]] * FRAMES  # no motion: the warp neither smooths nor shifts
    result = measure(still, flickering(pan(texture(1))[:1] * FRAMES, sigma))
    for delta in ("delta_1", "delta_5"):
        assert result.summary[delta]["error"] == pytest.approx(2 * sigma**2, rel=0.05)
        assert result.summary[delta]["floor"] < 1e-9


def test_stylisation_that_changes_nothing_is_at_the_floor():
    result = measure(pan(texture(0)), pan(texture(0)))
    assert all(pair.error == pair.floor for pair in result.pairs)
    assert all(pair.masked_error == pair.masked_floor for pair in result.pairs)


def test_there_is_a_row_for_every_pair_and_the_summary_is_their_mean():
    result = measure(pan(texture(0)), flickering(pan(texture(1)), 0.05))
    assert [(p.first, p.second, p.delta) for p in result.pairs] == [
        (i, i + delta, delta) for delta in (1, 5) for i in range(FRAMES - delta)
    ]
    short = [pair.error for pair in result.pairs if pair.delta == 1]
    assert result.summary["delta_1"]["error"] == pytest.approx(np.mean(short))
    assert result.summary["delta_1"]["pairs"] == FRAMES - 1


def test_files_and_arrays_give_the_same(tmp_path):
    sides = {"plain": pan(texture(0))[:4], "painted": pan(texture(1))[:4]}
    paths = {side: [tmp_path / f"{side}{i}.png" for i in range(4)] for side in sides}
    for side, frames in sides.items():
        for path, frame in zip(paths[side], frames, strict=True):
            write_rgb(path, frame, bits=16)
    from_files = measure(paths["plain"], paths["painted"], deltas=(1,))
    from_arrays = measure(sides["plain"], sides["painted"], deltas=(1,))
    for file_row, array_row in zip(from_files.pairs, from_arrays.pairs, strict=True):
        assert astuple(file_row) == pytest.approx(astuple(array_row), rel=1e-2, abs=1e-6)


def test_float_images_are_compared_as_they_are(tmp_path):
    frames = pan(texture(0))[:2]
    paths = [tmp_path / f"{i}.exr" for i in range(2)]
    whole = np.ones((HEIGHT, WIDTH), np.float32)
    for path, frame in zip(paths, frames, strict=True):
        write_float_image(path, np.ascontiguousarray(frame), whole, whole, half=False)
    from_files, from_arrays = (measure(side, frames, deltas=(1,)) for side in (paths, frames))
    assert from_files.pairs == from_arrays.pairs


def test_frames_are_read_when_their_turn_comes():
    read = []

    class Recorder(list):
        def __iter__(self):
            for index, frame in enumerate(super().__iter__()):
                read.append(index)
                yield frame

    seen = []

    def progress(done, total, **quality):
        seen.append((done, total, max(read)))

    measure(Recorder(pan(texture(0))), pan(texture(1)), deltas=(1,), progress=progress)
    assert seen == [(i, FRAMES - 1, i) for i in range(1, FRAMES)]


def test_a_flash_from_black_to_white_is_an_error_of_one():
    flash = [np.zeros((20, 20, 3), np.float32), np.ones((20, 20, 3), np.float32)]
    pair = measure([texture(0, WIDTH)[:20, :20]] * 2, flash, deltas=(1,)).pairs[0]
    assert (pair.error, pair.floor, pair.masked_error) == (1, 0, 1)


def test_frames_with_nothing_in_common_are_mostly_invalid():
    frames = [texture(seed, WIDTH) for seed in range(2)]
    assert measure(frames, frames, deltas=(1,)).pairs[0].valid_fraction < 0.6


def test_a_distance_without_pairs_is_null():
    result = measure(pan(texture(0))[:3], pan(texture(1))[:3])
    assert result.summary["delta_5"] == {
        "pairs": 0,
        "error": None,
        "floor": None,
        "valid_fraction": None,
        "masked_error": None,
        "masked_floor": None,
    }
    assert all(math.isfinite(pair.error) for pair in result.pairs)


def test_what_cannot_be_compared_is_refused():
    plain, painted = pan(texture(0)), pan(texture(1))
    with pytest.raises(InputError, match="8 unstylised and 7 stylised"):
        measure(plain, painted[:-1])
    with pytest.raises(InputError, match="no pair"):
        measure(plain[:1], painted[:1])
    with pytest.raises(InputError, match="no pair"):
        measure(plain, painted, deltas=(0, 1))
    with pytest.raises(InputError, match=r"frame 3: mixes sizes of 90x72 and 96x72"):
        measure(plain, [*painted[:3], painted[3][:, :90], *painted[4:]])
