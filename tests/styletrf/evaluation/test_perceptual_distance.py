import math

import cv2
import numpy as np
import pytest

from styletrf.evaluation.perceptual_distance import (
    PerceptualFeatures,
    grams,
    masked_distances,
    perceptual_distance,
    style_distance,
)


def picture(seed, height=48, width=64):
    noise = np.random.default_rng(seed).random((height, width, 3)).astype(np.float32)
    return cv2.GaussianBlur(noise, (0, 0), 1.5)


@pytest.fixture
def look(vgg):
    return PerceptualFeatures(vgg, 64)


def masked(look, a, b, mask):
    (found,) = masked_distances(look, [a], [look.features(a)], [b], mask)
    return found


def test_pictures_looked_at_together_look_the_same(look):
    a, b = picture(0), picture(1)
    for alone, beside in zip((a, b), look.features_of([a, b]), strict=True):
        assert perceptual_distance(look.features(alone), beside) == pytest.approx(0, abs=1e-6)


def test_distance_is_a_symmetric_and_zero_between_equals(look):
    a, b = look.features(picture(0)), look.features(picture(1))
    assert perceptual_distance(a, a) == pytest.approx(0, abs=1e-6)
    assert perceptual_distance(a, b) == pytest.approx(perceptual_distance(b, a))
    assert 0 < perceptual_distance(a, b) < 2


def test_distance_grows_with_the_blur(look):
    sharp = picture(0)
    distances = [
        perceptual_distance(
            look.features(sharp), look.features(cv2.GaussianBlur(sharp, (0, 0), sigma))
        )
        for sigma in (0.5, 1.0, 2.0)
    ]
    assert distances == sorted(distances)


def test_what_is_masked_out_does_not_count(look):
    a, b = picture(0), picture(0).copy()
    mask = np.ones(a.shape[:2], bool)
    mask[:, 40:] = False
    b[:, 40:] = 1 - b[:, 40:]
    assert masked(look, a, b, mask) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("columns", [64, 32, 24])
def test_the_mean_is_over_what_is_seen(look, columns):
    """Of two unrelated pictures any part is as unlike as all; little of it weighs no more."""
    a, b = picture(0, 64, 64), picture(1, 64, 64)
    mask = np.ones(a.shape[:2], bool)
    whole = masked(look, a, b, mask)
    mask[:, columns:] = False
    assert masked(look, a, b, mask) == pytest.approx(whole, rel=0.25)


def test_nothing_seen_has_no_distance(look):
    a = picture(0)
    none = np.zeros(a.shape[:2], bool)
    assert math.isnan(masked(look, a, a, none))


def test_style_does_not_depend_on_the_place(look):
    painting = picture(0)
    turned = np.roll(painting, 16, axis=1)
    target, found, pale = (grams(look.features(p)) for p in (painting, turned, 0.5 * painting))
    assert style_distance(found, target) < 0.5 * style_distance(pale, target)


@pytest.mark.parametrize("size", [(16, 16), (8, 300), (300, 9)])
def test_a_picture_of_an_odd_size_has_no_distance_to_itself(look, size):
    features = look.features(picture(0, *size))
    assert perceptual_distance(features, features) == pytest.approx(0, abs=1e-6)


def test_black_pictures_have_finite_distances(look):
    black, other = look.features(np.zeros((48, 64, 3), np.float32)), look.features(picture(0))
    assert math.isfinite(perceptual_distance(black, other))
    assert math.isfinite(style_distance(grams(other), grams(black)))
