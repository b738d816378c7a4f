"""Distances of pictures as they look, and along depths: flat, dark and far."""

import numpy as np
import pytest
import torch
from kernel_cases import generator

from styletrf.evaluation.consistency.geometric_consistency import (
    Correspondence,
    corresponding,
    geometric_errors,
)
from styletrf.evaluation.perceptual_distance import (
    STYLE_LAYERS,
    grams,
    perceptual_distance,
    style_distance,
)
from styletrf.geometry.cameras import Camera

PERCEPTUAL = pytest.mark.extremes("Perceptual and style distance")
GEOMETRIC = pytest.mark.extremes("Consistency along depths")
PRECISIONS = pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])


def features(size, dtype, seed):
    return {
        layer: (size * torch.randn(1, 8, 12, 12, generator=generator(seed + k))).to(dtype)
        for k, layer in enumerate(STYLE_LAYERS)
    }


def exact_distance(a, b):
    """The definition in float64, with the same least length."""
    unit = [
        {
            n: f.double() / f.double().norm(dim=1, keepdim=True).clamp(min=1e-12)
            for n, f in x.items()
        }
        for x in (a, b)
    ]
    return np.mean([float((unit[0][n] - unit[1][n]).square().sum(1).mean()) for n in STYLE_LAYERS])


@PERCEPTUAL
@PRECISIONS
@pytest.mark.parametrize("size", [0.0, 1e-30, 1e-6, 1.0, 1e18])
def test_a_perceptual_distance_is_from_0_to_4_and_0_of_equals(dtype, size, stability):
    """Unit vectors are at most 2 apart; features of no length are as near as can be."""
    a, b = features(size, dtype, 0), features(size, dtype, 10)
    assert perceptual_distance(a, a) == 0
    found = perceptual_distance(a, b)
    assert 0 <= found <= 4
    precision = str(dtype).removeprefix("torch.")
    stability(f"features of {size:g}", found, exact_distance(a, b), precision=precision)


@PERCEPTUAL
@PRECISIONS
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_a_style_distance_does_not_depend_on_the_size_of_features(dtype, size, stability):
    both = features(size, dtype, 0), features(size, dtype, 10)
    a, b = map(grams, both)
    assert style_distance(a, a) == 0
    exact = style_distance(*(grams({n: f.double() for n, f in x.items()}) for x in both))
    found = style_distance(a, b)
    assert found == pytest.approx(exact, rel=1e-4)
    stability(f"features of {size:g}", found, exact, precision=str(dtype).removeprefix("torch."))


@GEOMETRIC
@pytest.mark.parametrize("depth", [1e-6, 1.0, 1e12, np.inf])
@pytest.mark.parametrize("level", [0.0, 1.0])
def test_a_flat_wall_at_any_depth_is_steady(depth, level, stability):
    """No error where both frames see it; nothing at all where the step leads out of it."""
    cameras = [
        Camera(f"{k}", 16, 12, 20.0, 20.0, 8.0, 6.0, np.column_stack([np.eye(3), [k / 10, 0, 0]]))
        for k in range(2)
    ]
    wall = np.full((12, 16), depth, dtype=np.float32)
    flat = np.full((12, 16, 3), level, dtype=np.float32)
    warped = corresponding((cameras[0], cameras[1]), (wall, wall), flat, flat, 0.02)
    errors = geometric_errors(flat, flat, warped)
    assert (errors.geometric_fraction > 0) == (depth >= 1)
    assert np.isnan(errors.geometric_error) == (depth < 1)
    assert np.isnan(errors.normalized_error), "what has no detail has no error by it"
    expected = np.nan if depth < 1 else 0.0
    stability(f"flat wall at {depth:g}", errors.geometric_error, expected)


@GEOMETRIC
@pytest.mark.parametrize("contrast", [0.0, 1e-30, 1e-9, 1e-3, 1.0, 1e9])
@pytest.mark.parametrize("level", [0.0, 0.5])
def test_pictures_of_any_contrast_are_between_equal_and_unrelated(contrast, level, stability):
    """Equal ones, against a scene with detail: 0 by and by, and 1 where nothing is to be seen."""
    random = np.random.default_rng(0)
    scene = random.random((24, 32, 3)).astype(np.float32)
    picture = (level + contrast * random.random((24, 32, 3))).astype(np.float32)
    seen = np.ones(scene.shape[:2], bool)
    found = geometric_errors(scene, picture, Correspondence(scene, picture, seen))
    assert 0 <= found.normalized_error <= 1 + 1e-9
    if contrast == 1.0:
        assert found.normalized_error < 1e-4
    if contrast < 1e-6:
        assert found.normalized_error > 0.999
    exact = picture.astype(np.float64)
    precise = geometric_errors(scene, exact, Correspondence(scene, exact, seen))
    stability(
        f"contrast {contrast:g} about {level:g}", found.normalized_error, precise.normalized_error,
        precision="float32",
    )  # fmt: skip
