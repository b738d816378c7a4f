"""Sliced Wasserstein distances: closed forms, invariances, and pictures at the extremes."""

import math

import numpy as np
import pytest
from expected_errors import rejects

from styletrf.evaluation.resemblance.sliced_wasserstein import (
    SlicedWassersteinConfig,
    color_distance,
    patch_distance,
    picture_projections,
    projected,
    random_directions,
    sliced_wasserstein,
    texture_distance,
)

CONFIG = SlicedWassersteinConfig(samples=2000)
DISTANCES = (color_distance, patch_distance, texture_distance)


def noise(seed: int, height: int = 40, width: int = 48) -> np.ndarray:
    return np.random.default_rng(seed).random((height, width, 3)).astype(np.float32)


def of(image: np.ndarray):
    return picture_projections(image, CONFIG)


@pytest.mark.parametrize("distance", DISTANCES)
def test_a_sliced_distance_is_zero_to_itself_and_symmetric(distance):
    a, b = of(noise(0)), of(0.5 * noise(1, 60, 33))
    assert distance(a, a) == 0
    assert distance(a, b) == distance(b, a) > 0


def test_in_one_dimension_it_is_the_closed_form_of_gaussians():
    """W_2^2 = (m_a - m_b)^2 + (s_a - s_b)^2."""
    points = np.random.default_rng(0).standard_normal((20000, 1)).astype(np.float32)
    a, b = projected(points, CONFIG), projected(3 * points + 4, CONFIG)
    assert sliced_wasserstein(a, b) == pytest.approx(math.hypot(4, 2), rel=0.02)


def test_a_translation_is_as_long_as_the_directions_see_it():
    points = np.random.default_rng(0).standard_normal((500, 3)).astype(np.float32)
    shift = np.array([1.0, 2.0, -2.0], np.float32)
    seen = np.sqrt(np.mean((random_directions(3, CONFIG) @ shift) ** 2))
    found = sliced_wasserstein(projected(points, CONFIG), projected(points + shift, CONFIG))
    assert found == pytest.approx(seen, rel=1e-4)
    assert found == pytest.approx(3 / math.sqrt(3), rel=0.2)


def test_points_that_are_all_there_twice_are_no_farther():
    a, b = (np.random.default_rng(k).random((300, 3)).astype(np.float32) for k in range(2))
    once, twice = projected(b, CONFIG), projected(np.concatenate([b, b]), CONFIG)
    assert sliced_wasserstein(once, twice) == 0
    near = sliced_wasserstein(projected(a, CONFIG), once)
    assert sliced_wasserstein(projected(a, CONFIG), twice) == pytest.approx(near, rel=0.01)


def test_colors_have_no_places_and_patches_do():
    image = np.repeat(np.repeat(noise(0, 5, 6), 8, axis=0), 8, axis=1)
    shuffled = np.random.default_rng(1).permutation(image.reshape(-1, 3)).reshape(image.shape)
    assert color_distance(of(image), of(shuffled)) == 0
    assert patch_distance(of(image), of(shuffled)) > 5
    assert texture_distance(of(image), of(shuffled)) > 5


def test_texture_is_what_a_shift_of_lightness_leaves_alone():
    gray = np.full((40, 40, 3), 0.3, np.float32)
    lighter = np.full((40, 40, 3), 0.8, np.float32)
    assert patch_distance(of(gray), of(lighter)) > 5
    assert texture_distance(of(gray), of(lighter)) == pytest.approx(0, abs=1e-4)


@pytest.mark.parametrize("image", [
    np.zeros((40, 40, 3), np.float32), np.ones((40, 40, 3), np.float32), noise(3),
    noise(4, 16, 16), noise(5, 7, 500), 3 * noise(6) - 1,
], ids=["black", "white", "noise", "16 px", "long", "beyond [0, 1]"])  # fmt: skip
def test_sliced_distances_of_extreme_pictures_are_finite(image):
    for distance in DISTANCES:
        assert math.isfinite(distance(of(image), of(noise(7))))


def test_a_picture_smaller_than_a_patch_is_refused():
    with rejects("50x6"):
        of(noise(0, 6, 50))
