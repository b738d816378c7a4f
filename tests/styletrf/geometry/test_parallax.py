"""What photographs share fits one homography between two, unless there is depth."""

import numpy as np
import pytest
from captures import arc, looking, seen

from styletrf.geometry.parallax import LEAST_PARALLAX, parallax_fraction

RNG = np.random.default_rng(0)
ACROSS = RNG.uniform(-0.8, 0.8, (800, 2))
WALL = np.column_stack([ACROSS, np.zeros(800)])
ASIDE = [looking(np.array([x, 0.0, -3.0]), np.array([x / 2, 0.0, 0.0])) for x in (-0.5, 0.0, 0.5)]
TURNED = [looking(np.array([0.0, 0.0, -3.0]), np.array([x, 0.0, 0.0])) for x in (-0.4, 0.0, 0.4)]
RELIEF = WALL + np.array([0, 0, -0.8]) * (RNG.random((800, 1)) < 0.1)  # a tenth stands before it


@pytest.mark.parametrize(
    ("cameras", "points"),
    [(ASIDE, WALL), (TURNED, WALL), (TURNED, RELIEF), (TURNED, RNG.uniform(-0.8, 0.8, (800, 3)))],
)
def test_a_flat_wall_and_a_camera_that_only_turns_have_no_parallax(cameras, points):
    assert parallax_fraction(seen(cameras, points), cameras) < LEAST_PARALLAX


def test_a_facade_has_as_much_parallax_as_stands_before_it():
    assert parallax_fraction(seen(ASIDE, RELIEF), ASIDE) == pytest.approx(0.1, abs=0.03)


def test_what_is_seen_from_all_around_has_parallax():
    cameras = arc(20, n=8)
    solid = RNG.uniform(-0.7, 0.7, (500, 3))
    assert parallax_fraction(seen(cameras, solid), cameras) > 0.2


def test_photographs_that_share_nothing_have_none():
    few = seen(ASIDE, WALL[:10])
    assert parallax_fraction(few, ASIDE) == 0.0
