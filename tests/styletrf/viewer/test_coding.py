"""Codes come back as they were, and are as near to the values as they say."""

import zlib

import numpy as np
import pytest

from styletrf.viewer.coding import (
    COLOR_LEVELS,
    Codes,
    color_codes,
    density_codes,
    packed_codes,
    shown_colors,
    spacings_of,
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
def test_codes_of_spacing_1_come_back(channels, n_bytes):
    rng = np.random.default_rng(0)
    codes = rng.integers(0, COLOR_LEVELS if channels == 3 else 2**16, (BRICKS * 512, channels))
    spacings = (rng.random((BRICKS, 512)) < 0.5).astype(np.uint8)
    back = unpacked(packed_codes(codes, spacings, n_bytes), channels, n_bytes)
    is_exact = spacings.ravel() == 1
    np.testing.assert_array_equal(back[is_exact], codes[is_exact])


def test_codes_without_a_spacing_take_no_room():
    codes = np.random.default_rng(0).integers(0, COLOR_LEVELS, (BRICKS * 512, 3))
    nothing = np.zeros((BRICKS, 512), np.uint8)
    assert len(packed_codes(codes, nothing, 1)) < 100


def test_a_channel_is_at_most_half_its_spacing_off():
    rng = np.random.default_rng(0)
    codes = rng.integers(0, 2**16, (BRICKS * 512, 1))
    spacings = (2 * rng.integers(0, 16, (BRICKS, 512)) + 1).astype(np.uint8)
    back = unpacked(packed_codes(codes, spacings, 2), 1, 2)
    assert (np.abs(back - codes).ravel() <= spacings.ravel() // 2).all()


def test_wider_spacings_take_less_room():
    codes = np.random.default_rng(0).integers(0, COLOR_LEVELS, (BRICKS * 512, 3))
    sizes = [
        len(packed_codes(codes, np.full((BRICKS, 512), spacing, np.uint8), 1))
        for spacing in (1, 5, 15, 31)
    ]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[-1] < sizes[0] / 2


@pytest.mark.parametrize("share", [0.0, 0.5, 4.0])
def test_spacings_are_odd_and_widen_where_weights_fall(share):
    spacings = spacings_of(np.arange(256, dtype=np.uint8)[None].repeat(2, 1), share).ravel()
    used = spacings[spacings > 0]
    assert spacings[0] == 0
    assert (used % 2 == 1).all()
    assert (np.diff(used.astype(int)) <= 0).all()
    assert ((used - 1) * (np.flatnonzero(spacings) // 2) / 255 <= share).all()


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


@pytest.mark.parametrize("spread", [20, COLOR_LEVELS])
def test_a_look_shows_what_the_browser_makes_of_its_codes(spread):
    rng = np.random.default_rng(0)
    codes = rng.integers(0, spread, (3 * 512, 3)).astype(np.int32)
    spacings = rng.choice(np.array([0, 1, 3, 31], np.uint8), (3, 512))
    shown = shown_colors(Codes(0.0, 1.0, codes), spacings).codes
    back = unpacked(packed_codes(codes, spacings, 1), 3, 1)
    np.testing.assert_array_equal(shown, back.clip(0, COLOR_LEVELS - 1))
