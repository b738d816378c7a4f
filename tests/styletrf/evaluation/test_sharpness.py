"""Sharpness: whatever the contrast, less by blur, and 0 where nothing varies."""

import cv2
import numpy as np
import pytest

from styletrf.evaluation.sharpness import sharpness

NOISE = np.random.default_rng(0).random((64, 64, 3)).astype(np.float32)


def test_levels_scaled_and_shifted_are_as_sharp():
    assert sharpness(0.3 * NOISE + 0.2) == pytest.approx(sharpness(NOISE), rel=1e-4)


def test_of_white_noise_it_is_that_of_the_kernel():
    """Independent pixels: the variance of 4 x - the four neighbors is 16 + 4."""
    assert sharpness(NOISE) == pytest.approx(np.sqrt(20), rel=0.05)


def test_blur_takes_it_and_a_checkerboard_has_most():
    assert sharpness(cv2.GaussianBlur(NOISE, (0, 0), 1.5)) < 0.5 * sharpness(NOISE)
    board = np.indices((64, 64)).sum(axis=0) % 2
    assert sharpness(np.repeat(board[..., None], 3, axis=2).astype(np.float32)) == pytest.approx(8)


@pytest.mark.parametrize("level", [0.0, 0.4, 1.0])
def test_where_nothing_varies_it_is_zero(level):
    assert sharpness(np.full((20, 30, 3), level, np.float32)) == 0
