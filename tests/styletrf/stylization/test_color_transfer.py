"""Colors that keep a mean and a covariance, or a lightness."""

import cv2
import numpy as np
import pytest

from styletrf.stylization.color_transfer import (
    MOST_GAIN,
    MOST_GAIN_TO_PAINTING,
    color_map,
    in_colors,
)


def views(seed: int, spread=(0.1, 0.05, 0.02)) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    mixing = rng.normal(size=(3, 3)) * np.array(spread)[:, None]
    colors = 0.5 + rng.normal(size=(2, 24, 32, 3)) @ mixing
    return [image.clip(0, 1).astype(np.float32) for image in colors]


PAINTING = np.random.default_rng(9).uniform(size=(20, 20, 3)).astype(np.float32)


def all_colors(images) -> np.ndarray:
    return np.concatenate([image.reshape(-1, 3) for image in images]).astype(np.float64)


def test_the_map_gives_mean_and_covariance():
    source, target = all_colors(views(0)), all_colors(views(1))
    matrix, offset = color_map(source, target)
    moved = source @ matrix.T + offset
    np.testing.assert_allclose(moved.mean(axis=0), target.mean(axis=0), atol=1e-9)
    np.testing.assert_allclose(
        np.cov(moved, rowvar=False), np.cov(target, rowvar=False), rtol=0.1, atol=2e-4
    )
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-9, err_msg="moves colors least")


def test_the_map_gives_the_mean_of_millions_of_colors():
    """Sums in float32 lose what is small beside them: a large drawing lightened all views."""
    source, light = all_colors(views(0)), all_colors(views(1)).astype(np.float32) ** 0.1
    matrix, offset = color_map(source, np.tile(light, (1000, 1)))
    moved = (source @ matrix.T + offset).mean(axis=0)
    np.testing.assert_allclose(moved, light.mean(axis=0, dtype=np.float64), atol=1e-6)


@pytest.mark.parametrize("colors", ["style", "photograph"])
def test_a_ground_that_is_empty_does_not_change_the_colors_of_the_object(colors):
    painted, plain = views(0), views(1)
    rows = slice(0, 10)
    opacity = np.zeros((24, 32), np.float32)
    opacity[rows] = 1
    alone = in_colors([p[rows] for p in painted], [p[rows] for p in plain], PAINTING, colors)
    for image in (*painted, *plain):
        image[10:] = 0.9
    whole = in_colors(painted, plain, PAINTING, colors, [opacity, opacity])
    for image, expected in zip(whole, alone, strict=True):
        np.testing.assert_allclose(image[rows], expected, atol=1e-2)


@pytest.mark.parametrize("colors", ["style", "photograph"])
def test_views_that_show_nothing_keep_finite_colors(colors):
    nothing = [np.zeros((24, 32), np.float32)] * 2
    every, none = (in_colors(views(0), views(1), PAINTING, colors, o) for o in (None, nothing))
    np.testing.assert_allclose(none, every, atol=1e-2)


def test_colors_that_fit_already_stay():
    colors = all_colors(views(2))
    matrix, offset = color_map(colors, colors)
    np.testing.assert_allclose(colors @ matrix.T + offset, colors, atol=2e-2)


@pytest.mark.extremes("Color transfer")
@pytest.mark.parametrize("level", [0.0, 0.5, 1.0])
def test_a_painting_in_grays_is_not_blown_up(level):
    gray = [np.full((20, 20, 3), level, dtype=np.float32) for _ in range(2)]
    gray[0] += np.random.default_rng(0).normal(0, 1e-4, (20, 20, 1)).astype(np.float32)
    target = views(1)
    matrix, _ = color_map(all_colors(gray), all_colors(target))
    assert np.linalg.norm(matrix, 2) <= MOST_GAIN * 3
    recolored = in_colors(gray, target, PAINTING, "photograph")
    assert all(np.isfinite(image).all() for image in recolored)
    assert np.isfinite(color_map(all_colors(target), all_colors(gray[1:] * 2))[0]).all()


def test_one_map_for_all_views_keeps_equal_colors_equal():
    painted = views(0)
    painted[1][:4, :4] = painted[0][:4, :4]
    recolored = in_colors(painted, views(1), PAINTING, "photograph")
    np.testing.assert_array_equal(recolored[0][:4, :4], recolored[1][:4, :4])


def test_luminance_keeps_the_hues_of_the_photograph():
    painted, plain = views(0, (0.02, 0.02, 0.02)), views(1, (0.02, 0.02, 0.02))
    for new, hue, light in zip(
        in_colors(painted, plain, PAINTING, "luminance"), plain, painted, strict=True
    ):
        lab = [cv2.cvtColor(image, cv2.COLOR_RGB2LAB) for image in (new, hue, light)]
        np.testing.assert_allclose(lab[0][..., 0], lab[2][..., 0], atol=0.3)
        np.testing.assert_allclose(lab[0][..., 1:], lab[1][..., 1:], atol=0.5)


def deviation(images) -> float:
    return float(np.sqrt(np.mean([image.var(axis=(0, 1)).mean() for image in images])))


@pytest.mark.parametrize("faint", [0.8, 1.0, 1.3])
def test_the_style_has_the_mean_and_the_covariance_of_the_painting(faint):
    plain = views(1, (0.05, 0.05, 0.05))
    painting = plain[0][::-1] + np.float32(0.1)
    painted = [0.5 + faint * (image - 0.5) for image in plain]
    shown = np.concatenate([i.reshape(-1, 3) for i in in_colors(painted, plain, painting, "style")])
    np.testing.assert_allclose(shown.mean(axis=0), painting.mean(axis=(0, 1)), atol=0.01)
    covariances = [np.cov(c, rowvar=False) for c in (shown, painting.reshape(-1, 3))]
    np.testing.assert_allclose(*covariances, atol=0.1 * covariances[1].max())


def test_the_map_to_the_painting_stretches_no_axis_beyond_its_limit():
    faint, bold = views(1, (0.01, 0.01, 0.01)), views(2, (0.1, 0.1, 0.1))[0]
    shown = in_colors(faint, faint, bold, "style")
    gain = deviation(shown) / deviation(faint)
    assert 1.4 < gain < 1.01 * MOST_GAIN_TO_PAINTING, "one axis may need less"


def test_a_pale_painting_stays_pale():
    plain, pale = views(1), 0.5 + 0.02 * np.random.default_rng(0).normal(size=(32, 32, 3))
    painted = [(0.5 + 0.1 * (image - 0.5)).astype(np.float32) for image in plain]
    shown = in_colors(painted, plain, pale.astype(np.float32), "style")
    assert deviation(shown) <= max(deviation(painted), deviation([pale])) * 1.01
