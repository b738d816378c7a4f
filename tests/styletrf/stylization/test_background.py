"""Objects on an empty ground: what the painter sees, and what is put back."""

from dataclasses import replace

import numpy as np
import pytest

from styletrf.files.float_images import FloatImage
from styletrf.stylization.background import empty_background, replace_background, restore_background

WHITE = np.float32([1, 1, 1])


def view(seed, fraction=0.3, ground=WHITE, rim=1.0):
    """An object of random colors in a corner, its last row half transparent."""
    random = np.random.default_rng(seed)
    opacity = np.zeros((20, 30), np.float32)
    opacity[: int(20 * fraction)] = 1
    opacity[max(int(20 * fraction) - 1, 0)] *= rim
    color = random.uniform(0.1, 0.5, (20, 30, 3)).astype(np.float32)
    color = opacity[..., None] * color + (1 - opacity[..., None]) * ground
    return FloatImage(color.astype(np.float32), opacity, np.ones_like(opacity))


def test_the_background_is_the_color_of_nothing_and_the_mean_of_all_else():
    views = [view(0, rim=0.5), view(1)]
    ground = empty_background(views)
    assert ground.shown == pytest.approx(WHITE)
    assert ground.mean == pytest.approx([0.3] * 3, abs=0.02), "of uniform colors from 0.1 to 0.5"


def test_what_is_painted_has_no_background_to_differ_from():
    views = [view(0)]
    (seen,) = replace_background(views, empty_background(views))
    empty = views[0].opacity == 0
    assert np.ptp(seen[empty], axis=0) == pytest.approx(0)
    assert seen[empty].mean(axis=0) == pytest.approx(seen[~empty].mean(axis=0), abs=1e-5)
    assert np.array_equal(seen[~empty], views[0].color[~empty])


def test_a_painter_that_changes_nothing_gives_the_views_back():
    views = [view(0), view(1)]
    ground = empty_background(views)
    given = restore_background(replace_background(views, ground), views, ground)
    for image, before in zip(given, views, strict=True):
        assert image == pytest.approx(before.color, abs=1e-6)


def test_the_background_is_not_painted_and_the_object_is():
    views = [view(0, rim=0.5)]
    ground = empty_background(views)
    (image,) = restore_background([np.zeros((20, 30, 3), np.float32)], views, ground)
    assert image[views[0].opacity == 0] == pytest.approx(1)
    assert image[views[0].opacity == 1] == pytest.approx(0)
    assert image[views[0].opacity == 0.5] == pytest.approx(0.5)


@pytest.mark.parametrize("fraction", [1.0, 0.0])
def test_views_that_are_full_or_empty_are_painted_as_they_are(fraction):
    views = [view(0, fraction)]
    assert empty_background(views) is None
    assert np.array_equal(replace_background(views, None)[0], views[0].color)
    assert np.array_equal(restore_background([views[0].color], views, None)[0], views[0].color)


def test_a_few_rays_that_miss_are_no_background():
    full = view(0, 1.0)
    full.opacity[0, :3] = 0
    assert empty_background([full]) is None
    assert empty_background([full, view(1, 0.5)]) is not None


def test_a_learnt_sky_is_a_background_of_its_color():
    sky = np.float32([0.4, 0.6, 0.9])
    assert empty_background([replace(view(0, ground=sky))]).shown == pytest.approx(sky, abs=1e-6)
