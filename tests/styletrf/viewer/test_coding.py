"""Codes come back as they were, and are as near to the values as they say."""

import zlib

import numpy as np
import pytest

from styletrf.viewer.coding import (
    COLOR_LEVELS,
    Codes,
    color_codes,
    density_codes,
    filled,
    packed_codes,
)

BRICKS = 3


def unpacked(packed: bytes, channels: int, n_bytes: int) -> np.ndarray:
    """What the browser does in `unpacking.js`."""
    planes = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(n_bytes, -1, 512, channels)
    codes = sum(planes[k].astype(np.int64) << 8 * k for k in range(n_bytes))
    codes = codes.transpose(2, 0, 1).copy()
    if n_bytes == 2:
        codes = ((codes >> 1) ^ -(codes & 1)) % 2**16
    for point in range(1, 512):
        steps = [step for step, of in ((1, 7), (8, 56), (64, 448)) if point & of]
        mean = sum(codes[..., point - step] for step in steps) // len(steps)
        codes[..., point] = (codes[..., point] + mean) % 2 ** (8 * n_bytes)
    if channels == 3:
        codes[[0, 2]] += codes[1] - 128
    return codes.reshape(channels, -1).T


@pytest.mark.parametrize(("channels", "n_bytes"), [(1, 2), (3, 1)])
def test_what_is_needed_comes_back(channels, n_bytes):
    rng = np.random.default_rng(0)
    codes = rng.integers(0, COLOR_LEVELS if channels == 3 else 2**16, (BRICKS * 512, channels))
    needed = rng.random((BRICKS, 512)) < 0.5
    back = unpacked(packed_codes(codes, needed, n_bytes), channels, n_bytes)
    np.testing.assert_array_equal(back[needed.ravel()], codes[needed.ravel()])


def test_what_is_not_needed_takes_no_room():
    codes = np.random.default_rng(0).integers(0, COLOR_LEVELS, (BRICKS * 512, 3))
    nothing = np.zeros((BRICKS, 512), bool)
    assert len(packed_codes(codes, nothing, 1)) < 100


@pytest.mark.parametrize("scale", [0.0, 1.0, 1e4])
def test_codes_are_within_half_a_step(scale):
    values = (scale * np.random.default_rng(0).normal(size=(512, 1))).astype(np.float32)
    found = density_codes(values, np.ones(512, bool))
    assert np.abs(found.values() - values).max() <= 0.51 * found.step
    assert found.step <= max(1 / 32, 10 * scale / 65535)


def test_colors_count_as_full_or_black_beyond_a_limit():
    values = np.array([[-50.0, 0.0, 50.0]] * 512, np.float32)
    found = color_codes(values, np.ones(512, bool))
    shown = 1 / (1 + np.exp(-found.values()))
    np.testing.assert_allclose(shown, [[0, 0.5, 1]] * 512, atol=0.03)


def test_a_look_shows_what_the_browser_makes_of_points_that_are_not_needed():
    rng = np.random.default_rng(0)
    codes = rng.integers(20, 40, (3 * 512, 3)).astype(np.int32)
    needed = rng.random((3, 512)) < 0.3
    shown = filled(Codes(0.0, 1.0, codes), needed).codes
    assert np.array_equal(shown[needed.ravel()], codes[needed.ravel()])
    # every point is needed, and none has a difference but those that were needed before
    assert packed_codes(shown, np.ones_like(needed), 1) == packed_codes(codes, needed, 1)
