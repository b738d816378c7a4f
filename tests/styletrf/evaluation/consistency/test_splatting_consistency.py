"""Softmax splatting and the protocol that compares frames by it."""

import numpy as np
import pytest

from styletrf.evaluation.consistency.splatting_consistency import (
    splatted,
    splatting_consistency,
    splatting_errors,
)
from styletrf.evaluation.flow import FlowEstimator

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
    np.testing.assert_allclose(moved, image, atol=1e-12)


@pytest.mark.parametrize(("x", "y"), [(3, 0), (0, -2), (-4, 5)])
def test_a_frame_moves_by_whole_pixels_and_leaves_a_gap(image, x, y):
    moved, covered = splatted(image, flow_of(x, y), even())
    expected = np.roll(image, (y, x), axis=(0, 1))
    inside = np.roll(np.ones((HEIGHT, WIDTH), bool), (y, x), axis=(0, 1))
    inside[: max(y, 0)] = inside[HEIGHT + min(y, 0) :] = False
    inside[:, : max(x, 0)] = inside[:, WIDTH + min(x, 0) :] = False
    np.testing.assert_array_equal(covered, inside)
    np.testing.assert_allclose(moved[inside], expected[inside], atol=1e-12)


def test_half_a_pixel_averages_two_neighbors(image):
    moved, _ = splatted(image, flow_of(0.5, 0), even())
    np.testing.assert_allclose(moved[:, 1:], (image[:, 1:] + image[:, :-1]) / 2, atol=1e-12)


def test_of_two_pixels_on_one_place_the_important_one_prevails(image):
    flow, importance = flow_of(0, 0).copy(), even()
    flow[4, 5] = (1, 0)  # onto (4, 6)
    importance[4, 5] = 40
    moved, _ = splatted(image, flow, importance)
    np.testing.assert_allclose(moved[4, 6], image[4, 5], atol=1e-12)


def test_what_is_added_to_all_importances_changes_nothing(image, rng):
    flow, importance = rng.normal(0, 2, (HEIGHT, WIDTH, 2)), rng.normal(0, 3, (HEIGHT, WIDTH))
    once, _ = splatted(image, flow, importance)
    again, _ = splatted(image, flow, importance - 900)
    np.testing.assert_allclose(once, again, atol=1e-12)


def test_colors_stay_within_those_of_the_frame(image, rng):
    moved, covered = splatted(image, rng.normal(0, 6, (HEIGHT, WIDTH, 2)), even())
    assert moved[covered].min() >= image.min() - 1e-12
    assert moved[covered].max() <= image.max() + 1e-12


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
    found = splatting_consistency([f.astype(np.float32) for f in frames], FlowEstimator("dis"))
    assert found["gap_1"]["rmse"] < 1e-6
    assert found["gap_1_whole"]["rmse"] > 1e-4
    assert set(found) == {"gap_1", "gap_1_whole", "gap_7", "gap_7_whole"}
    assert set(splatting_consistency(frames[:1], FlowEstimator("dis"))) == set()
