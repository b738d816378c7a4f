"""Softmax splatting and the protocol that compares frames by it."""

import math
import runpy
from pathlib import Path

import numpy as np
import pytest
import torch

from styletrf.errors import InputError
from styletrf.evaluation import raft_flow
from styletrf.evaluation.consistency.splatting_consistency import (
    importance,
    of_levels,
    splatted,
    splatting_consistency,
    splatting_errors,
)
from styletrf.evaluation.flow import FlowEstimator
from styletrf.files.images import write_png

BENCHMARKS = Path(__file__).parents[4] / "benchmarks"
HEIGHT, WIDTH = 20, 30


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.fixture
def image(rng):
    return rng.random((HEIGHT, WIDTH, 3))


def flow_of(x, y):
    return np.broadcast_to(np.array([x, y], dtype=np.float64), (HEIGHT, WIDTH, 2))


def even():
    return np.zeros((HEIGHT, WIDTH))


def test_a_frame_that_does_not_move_stays_as_it_is(image):
    moved, covered = splatted(image, flow_of(0, 0), even())
    assert covered.all()
    np.testing.assert_allclose(moved, image, atol=1e-6)


@pytest.mark.parametrize(("x", "y"), [(3, 0), (0, -2), (-4, 5)])
def test_a_frame_moves_by_whole_pixels_and_leaves_a_gap(image, x, y):
    moved, covered = splatted(image, flow_of(x, y), even())
    expected = np.roll(image, (y, x), axis=(0, 1))
    inside = np.roll(np.ones((HEIGHT, WIDTH), bool), (y, x), axis=(0, 1))
    inside[: max(y, 0)] = inside[HEIGHT + min(y, 0) :] = False
    inside[:, : max(x, 0)] = inside[:, WIDTH + min(x, 0) :] = False
    np.testing.assert_array_equal(covered, inside)
    np.testing.assert_allclose(moved[inside], expected[inside], atol=1e-6)


def test_half_a_pixel_averages_two_neighbors(image):
    moved, _ = splatted(image, flow_of(0.5, 0), even())
    np.testing.assert_allclose(moved[:, 1:], (image[:, 1:] + image[:, :-1]) / 2, atol=1e-6)


def test_of_two_pixels_on_one_place_the_important_one_prevails(image):
    flow, importance = flow_of(0, 0).copy(), even()
    flow[4, 5] = (1, 0)  # onto (4, 6)
    importance[4, 5] = 40
    moved, _ = splatted(image, flow, importance)
    np.testing.assert_allclose(moved[4, 6], image[4, 5], atol=1e-6)


def test_colors_stay_between_black_and_those_of_the_frame(image, rng):
    moved, covered = splatted(image, rng.normal(0, 6, (HEIGHT, WIDTH, 2)), even())
    assert moved[covered].min() > 0
    assert moved[covered].max() <= image.max() + 1e-12


def test_a_level_of_difference_and_a_place_outside_have_the_least_importance(image):
    levels = np.array([0, 0.5, 1, 200])
    other = image.copy()
    other[0, :4] -= levels[:, None] / 255
    flow = flow_of(0, 0).copy()
    flow[1, 0] = (-0.5, 0)
    found = importance(image, other, flow)
    np.testing.assert_allclose(found[0, :4], [0, -5, -10, -10], atol=1e-4)
    assert found[1, 0] == -10
    np.testing.assert_allclose(found[2:], 0, atol=1e-9)


def published_rmse(a, b, flow):
    """The published code, pixel by pixel in levels of 8 bits."""
    sums, weights = np.zeros((HEIGHT, WIDTH, 3)), np.zeros((HEIGHT, WIDTH, 1))
    for row, column in np.ndindex(HEIGHT, WIDTH):
        x, y = column + flow[row, column, 0], row + flow[row, column, 1]
        corners = [
            (v, u, (1 - abs(x - u)) * (1 - abs(y - v)))
            for u in (math.floor(x), math.floor(x) + 1)
            for v in (math.floor(y), math.floor(y) + 1)
            if 0 <= u < WIDTH and 0 <= v < HEIGHT
        ]
        there = sum((part * 255 * b[v, u] for v, u, part in corners), np.zeros(3))
        metric = np.clip(-10 * np.abs(255 * a[row, column] - there).mean(), -10, 10)
        for v, u, part in corners:
            sums[v, u] += part * np.exp(metric) * 255 * a[row, column]
            weights[v, u] += part * np.exp(metric)
    moved = sums / (weights + 1e-7)
    mask = moved.sum(axis=-1, keepdims=True) != 0
    return np.sqrt(np.mean((moved / 255 - 255 * b * mask / 255) ** 2))


def test_the_error_is_that_of_the_published_code(image, rng):
    """Frames with black, a level apart here and unlike there, and flow that leaves them."""
    a = np.where(rng.random((HEIGHT, WIDTH, 1)) < 0.3, 0, image)
    b = np.where(rng.random((HEIGHT, WIDTH, 1)) < 0.5, np.clip(a + 0.3 / 255, 0, 1), image[::-1])
    flow = rng.normal(0, 2, (HEIGHT, WIDTH, 2)) / rng.choice([1, 32], (HEIGHT, WIDTH, 1))
    errors = splatting_errors(a, b, lambda *_: flow)
    assert errors.rmse == pytest.approx(published_rmse(a, b, flow), rel=1e-5)
    assert errors.covered_rmse > errors.rmse


def test_a_known_translation_has_no_error_where_frames_overlap(image):
    a, b = image[:, 4:], image[:, :-4]
    shift = np.broadcast_to([4.0, 0.0], (*a.shape[:2], 2))
    found = splatting_errors(
        a, b, lambda *_: shift, {"apart": lambda x, y: float(np.abs(x - y).max())}
    )
    assert found.motion_px == 4
    assert found.covered_fraction == pytest.approx(1 - 4 / a.shape[1])
    for error in (found.rmse, found.covered_rmse, found.distances["apart"]):
        assert error == pytest.approx(0, abs=1e-6)


def test_distances_see_black_in_both_frames_where_nothing_is_splatted(image):
    seen = []
    flow = flow_of(0, 6)
    splatting_errors(image, image, lambda *_: flow, {"spy": lambda *pair: seen.extend(pair) or 0.0})
    assert len(seen) == 2
    for picture in seen:
        assert not picture[:6].any()
        assert picture[6:].any()


def test_frames_of_nothing_but_gaps_have_no_error_to_measure(image):
    found = splatting_errors(image, image, lambda *_: flow_of(99, 0))
    assert (found.rmse, found.covered_fraction) == (0, 0)
    assert math.isnan(found.covered_rmse)


def test_published_lpips_sees_levels(image):
    seen = []
    of_levels(lambda *pair: seen.extend(2 * x - 1 for x in pair) or 0.0)(image, 1 - image)
    np.testing.assert_allclose(seen, [255 * image, 255 * (1 - image)], atol=1e-9)


def test_flow_that_leads_out_of_the_image_covers_nothing(image):
    moved, covered = splatted(image, flow_of(1e9, 0), even())
    assert not covered.any()
    assert not moved.any()


def test_a_still_has_no_error_and_noise_has(rng):
    still = rng.random((64, 80, 3)).astype(np.float32)
    noisy = np.clip(still + rng.normal(0, 0.1, still.shape), 0, 1).astype(np.float32)
    estimator = FlowEstimator("dis")
    assert splatting_errors(still, still, estimator).rmse < 1e-6
    assert splatting_errors(still, noisy, estimator).rmse > 0.03


def test_the_published_error_counts_gaps_as_equal(rng):
    frame = rng.random((64, 80, 3)).astype(np.float32)
    other = rng.random((64, 80, 3)).astype(np.float32)
    errors = splatting_errors(frame, other, FlowEstimator("dis"))
    assert errors.rmse == pytest.approx(errors.covered_rmse * np.sqrt(errors.covered_fraction))
    assert errors.rmse <= errors.covered_rmse


def test_the_first_sixteen_frames_are_the_protocols(rng):
    still = rng.random((32, 40, 3)).astype(np.float32)
    frames = [still] * 16 + [np.clip(still + rng.normal(0, 0.2, still.shape), 0, 1)] * 2
    frames = [f.astype(np.float32) for f in frames]
    noise = {"noise": lambda a, b: float(np.abs(a - b).mean())}
    found = splatting_consistency(frames, FlowEstimator("dis"), noise)
    assert found["gap_1"]["noise"] < 1e-6 < found["gap_1_whole"]["noise"]
    assert found["gap_1"]["rmse"] < 1e-6
    assert found["gap_1_whole"]["rmse"] > 1e-4
    assert set(found) == {"gap_1", "gap_1_whole", "gap_7", "gap_7_whole"}
    assert set(splatting_consistency(frames[:1], FlowEstimator("dis"))) == set()


def test_frames_without_padded_numbers_are_read_in_the_order_of_their_numbers(tmp_path):
    script = runpy.run_path(str(BENCHMARKS / "splatting.py"))
    for number in (1, 2, 10, 11):
        picture = np.full((HEIGHT, WIDTH, 3), number, np.uint8)
        write_png(tmp_path / f"frame_{number}.png", picture, compression=1)
    read = [round(255 * float(frame.mean())) for frame in script["frames_in"](tmp_path, WIDTH)]
    assert read == [1, 2, 10, 11]


def test_the_flow_is_that_of_raft_where_its_weights_are_at_hand_and_else_of_dis(monkeypatch):
    script = runpy.run_path(str(BENCHMARKS / "splatting.py"))
    monkeypatch.setattr(torch.hub, "get_dir", lambda: "/nowhere")
    assert script["flow_by"]("auto")[0] == "dis"
    with pytest.raises(InputError):
        script["flow_by"]("raft")
    monkeypatch.setattr(raft_flow, "_network", lambda path: torch.nn.Identity())
    assert script["flow_by"]("auto")[0] == "raft"
