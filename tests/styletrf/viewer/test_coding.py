"""Codes come back as they were, and are as near to the values as they say."""

import zlib

import numpy as np
import pytest

from styletrf.viewer import lattice_kernels
from styletrf.viewer.coding import (
    FINEST,
    MOST_OF_COLORS,
    WIDEST_SPACING,
    Codes,
    color_codes,
    density_codes,
    packed_colors,
    packed_density,
    shown_colors,
    slope_codes,
    spacings_of,
)
from styletrf.viewer.compression import before
from styletrf.viewer.point_effects import CLASSES, effect_classes, packed_classes

BRICKS = 3
ALL = np.ones((BRICKS, 512), np.uint8)  # every point in the first class


def summed(differences: np.ndarray, modulus: int) -> np.ndarray:
    """What `summed` in `unpacking.js` does."""
    codes = differences.astype(np.int64)
    for point in range(1, 512):
        steps = [step for step, of in ((1, 7), (8, 56), (64, 448)) if point & of]
        mean = sum(codes[:, point - step] for step in steps) // len(steps)
        codes[:, point] = (codes[:, point] + mean) % modulus
    return codes


def unpacked_colors(
    packed: bytes, classes: np.ndarray, spacings: tuple[int, ...], by_green: bool
) -> np.ndarray:
    """What `colorsOf` in `unpacking.js` does."""
    of_channels = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(3, -1)
    found, multiples = [], of_channels.view(np.int8)
    apart = MOST_OF_COLORS if by_green else 0
    for k in range(3):
        codes, rest = np.zeros(classes.shape, np.int64), multiples[k, len(classes) :]
        codes[:, 0] = np.cumsum(of_channels[k, : len(classes)]) % 256 + (k != 1) * apart // 2
        for kind, spacing in enumerate(spacings):
            of_kind = classes == kind
            of_kind[:, 0] = False
            if spacing:
                here, rest = np.split(rest, [of_kind.sum()])
                codes[of_kind] = spacing * here.astype(np.int64)
        assert not rest.size
        found.append(summed(codes, 2**16).ravel())
    first, second, last = found
    added = second - apart if by_green else 0
    return np.stack([first + added, second, last + added], axis=1)


def unpacked_density(packed: bytes, counts: list[int]) -> np.ndarray:
    """What `densitiesOf` in `unpacking.js` does."""
    low, high = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(2, -1).astype(np.int64)
    starts, values = np.append(0, np.cumsum(counts)), low | high << 8
    zigzag = np.zeros((len(values) // 512, 512), np.int64)
    for brick in zigzag:
        for at in range(512):
            steps = [step for step, of in ((1, 7), (8, 56), (64, 448)) if at & of]
            context = int(sum(brick[at - step] for step in steps)).bit_length()
            brick[at] = values[starts[context]]
            starts[context] += 1
    return summed(((zigzag >> 1) ^ -(zigzag & 1)) % 2**16, 2**16)


def unpacked_classes(packed: bytes, counts: bytes) -> np.ndarray:
    """What `classesOf` in `unpacking.js` does."""
    values = np.frombuffer(zlib.decompress(packed), np.uint8)
    starts = np.append(0, np.cumsum(np.frombuffer(zlib.decompress(counts), "<u4").astype(int)))
    classes = np.zeros((len(values) // 512, 512), np.int64)
    for brick in classes:
        for at in range(512):
            steps = ((1, 7, 1), (8, 56, CLASSES + 1), (64, 448, (CLASSES + 1) ** 2))
            context = sum(brick[at - step] * of for step, mask, of in steps if at & mask)
            brick[at] = values[starts[context]]
            starts[context] += 1
    return classes


def of_colors(codes: np.ndarray, by_green: bool = True) -> Codes:
    return Codes(0.0, 1.0, codes.astype(np.int32), by_green)


def random_codes(most: int) -> np.ndarray:
    return np.random.default_rng(0).integers(0, most + 1, (BRICKS * 512, 3))


@pytest.mark.parametrize("by_green", [True, False])
def test_colors_of_spacing_1_come_back(by_green):
    codes = random_codes(63)
    packed = packed_colors(of_colors(codes, by_green), ALL, FINEST)
    np.testing.assert_array_equal(unpacked_colors(packed, ALL, FINEST, by_green), codes)


def test_colors_that_a_byte_cannot_lead_to_are_reached_a_point_later():
    red, blue = [MOST_OF_COLORS, 0, 0], [0, 0, MOST_OF_COLORS]
    codes = np.array([*[red] * 256, *[blue] * 256])
    packed = packed_colors(of_colors(codes), ALL[:1], FINEST)
    back = unpacked_colors(packed, ALL[:1], FINEST, by_green=True)
    wrong = (back != codes).any(axis=1)
    layers = wrong.reshape(8, 64)
    assert wrong[0]
    assert (
        wrong.sum() <= 64
    )  # the first point, and some of the layer that differs from the one before
    assert not np.delete(layers, [0, 4], axis=0).any()
    assert layers[0].sum() == 1


@pytest.mark.parametrize("most", [3, 2**16])
def test_densities_come_back_where_they_are_needed(most):
    rng = np.random.default_rng(0)
    codes = rng.integers(0, most, (BRICKS * 512, 1))
    needed = rng.random((BRICKS, 512)) < 0.7
    packed, counts = packed_density(codes, needed)
    back = unpacked_density(packed, counts)
    np.testing.assert_array_equal(back[needed], codes.reshape(back.shape)[needed])


def test_packed_classes_come_back_as_they_were():
    classes = np.random.default_rng(0).integers(0, CLASSES + 1, (BRICKS, 512)).astype(np.uint8)
    np.testing.assert_array_equal(unpacked_classes(*packed_classes(classes)), classes)


def test_a_channel_is_at_most_half_its_spacing_off():
    rng, most = np.random.default_rng(0), 2**16 - 1
    codes = rng.integers(0, most + 1, (BRICKS, 512), np.int32)
    spacings = 2 * rng.integers(0, 16, codes.shape, np.int32) + 1
    _, shown = lattice_kernels.multiples(codes, spacings, most, most)
    assert (np.abs(shown - codes) <= spacings // 2).all()


def test_points_without_a_spacing_take_no_room():
    codes = random_codes(MOST_OF_COLORS)
    assert len(packed_colors(of_colors(codes), np.zeros((BRICKS, 512), np.uint8), FINEST)) < 100
    assert len(packed_colors(of_colors(codes), ALL, (0,) * (CLASSES + 1))) < 100


def test_wider_spacings_take_less_room():
    codes = random_codes(MOST_OF_COLORS)
    sizes = [len(packed_colors(of_colors(codes), ALL, (0, spacing))) for spacing in (1, 9, 31, 63)]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[-1] < sizes[0] / 2


def test_values_that_their_contexts_tell_apart_take_less_room():
    rng = np.random.default_rng(0)
    classes = rng.integers(1, 3, (40, 512)).astype(np.uint8)
    smooth = np.full(classes.shape, MOST_OF_COLORS // 2)
    noise = rng.integers(-63, 64, classes.shape)
    codes = (smooth + np.where(classes == 2, noise, 0)).reshape(-1, 1).repeat(3, axis=1)
    spacings = (0, 127, 1)  # the first class has nearly no differences
    mixed = packed_colors(of_colors(codes), np.full_like(classes, 2), spacings)
    assert len(packed_colors(of_colors(codes), classes, spacings)) < 0.7 * len(mixed)


@pytest.mark.parametrize("finest", [1e-3, 0.7, 4.0])
def test_spacings_are_odd_and_at_most_double_and_one_from_class_to_class(finest):
    none, *spacings = spacings_of(finest)
    assert none == 0
    used = np.array([spacing for spacing in spacings if spacing])
    assert spacings == [*used, *[0] * (CLASSES - len(used))]
    assert (used % 2 == 1).all()
    assert used.max() <= WIDEST_SPACING
    assert (np.diff(used) >= 0).all()
    assert (used <= 1 + finest * 2.0 ** np.arange(len(used))).all()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_classes_halve_from_one_to_the_next_whatever_the_scale(scale):
    effects = scale * np.append(1.0, 0.5 ** np.arange(511)).reshape(1, 512).clip(1e-12)
    classes = effect_classes(effects.astype(np.float32))[0].astype(int)
    assert classes[1] == 1
    assert not classes[-1]
    used = classes[classes > 0]
    assert set(used) == set(range(1, CLASSES + 1))
    assert (np.diff(used) >= 0).all()
    assert not classes[len(used) :].any()


def test_effects_of_nothing_are_no_class():
    assert not effect_classes(np.zeros((2, 512), np.float32)).any()


def test_before_is_the_neighbor_in_the_same_brick():
    values = np.arange(1, 1025).reshape(2, 512)
    for axis, (step, side) in enumerate([(1, 8), (8, 64), (64, 512)]):
        found = before(values, axis)
        begins = np.arange(512) % side < step
        assert not found[:, begins].any()
        np.testing.assert_array_equal(found[:, ~begins], values[:, ~begins] - step)


@pytest.mark.parametrize("scale", [0.0, 1.0, 1e4])
def test_codes_are_within_half_a_step(scale):
    values = (scale * np.random.default_rng(0).normal(size=(512, 1))).astype(np.float32)
    found = density_codes(values, np.ones(512, bool))
    assert np.abs(found.values() - values).max() <= 0.51 * found.step
    assert found.step <= max(1 / 4, 10 * scale / 65535)


def test_colors_count_as_full_or_black_beyond_a_limit():
    values = np.array([[-50.0, 0.0, 50.0]] * 512, np.float32)
    found = color_codes(values, np.ones(512, bool))
    shown = 1 / (1 + np.exp(-found.values()))
    np.testing.assert_allclose(shown, [[0, 0.5, 1]] * 512, atol=0.03)


@pytest.mark.parametrize("by_green", [True, False])
@pytest.mark.parametrize("most", [20, MOST_OF_COLORS])
def test_a_look_shows_what_the_browser_makes_of_its_codes(most, by_green):
    rng = np.random.default_rng(0)
    codes = of_colors(random_codes(most), by_green)
    classes = rng.integers(0, CLASSES + 1, (BRICKS, 512)).astype(np.uint8)
    spacings = spacings_of(0.5)
    shown = shown_colors(codes, classes, spacings).codes
    back = unpacked_colors(packed_colors(codes, classes, spacings), classes, spacings, by_green)
    np.testing.assert_array_equal(shown, back.clip(0, MOST_OF_COLORS))


def test_slopes_are_within_half_a_step_or_as_steep_as_codes_reach():
    slopes = np.random.default_rng(0).normal(0, 2, (512, 3)).astype(np.float32)
    found = slope_codes(slopes, 14 / MOST_OF_COLORS)
    steepest = MOST_OF_COLORS // 2 * found.step
    assert found.step < 14 / MOST_OF_COLORS
    assert np.abs(found.values() - slopes.clip(-steepest, steepest)).max() <= 0.51 * found.step
