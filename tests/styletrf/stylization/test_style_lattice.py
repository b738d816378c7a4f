from dataclasses import replace

import numpy as np
import pytest

from styletrf.geometry.cameras import Camera, resized
from styletrf.geometry.space import Space
from styletrf.scene.contraction import contraction
from styletrf.stylization.strategies import StylizationConfig
from styletrf.stylization.style_lattice import StyleLatticeConfig, lattice_scale, points_per_pixel

FOCAL_PX, POINTS = 80.0, 101
BOX = Space("box", np.eye(4)[None], (1.0, 1.0, 1.0), 0.01)
WANTED = StyleLatticeConfig(points_per_px=0.6, min_scale=0.9, max_scale=4.0)


def camera_at(distance):
    """A camera that looks along +z at the middle of the box."""
    pose = np.column_stack([np.eye(3), [0.0, 0.0, -distance]])
    return Camera("0", 64, 48, FOCAL_PX, FOCAL_PX, 32.0, 24.0, pose)


def wall(depth):
    return np.full((48, 64), depth, np.float32)


@pytest.mark.parametrize("distance", [0.5, 1.0, 3.0])
def test_a_wall_across_the_view_has_the_points_of_a_pixels_footprint(distance):
    found = points_per_pixel(BOX, (POINTS,) * 3, camera_at(distance), wall(distance))
    assert found == pytest.approx(distance / FOCAL_PX * (POINTS - 1) / 2, rel=1e-6)


def test_the_coarsest_direction_across_the_view_counts():
    found = points_per_pixel(BOX, (POINTS, 11, POINTS), camera_at(1.0), wall(1.0))
    assert found == pytest.approx(10 / 2 / FOCAL_PX, rel=1e-6)


def test_far_away_in_unbounded_space_a_pixel_has_the_same_points_at_every_depth():
    space = replace(BOX, kind="unbounded", grid_from_world=contraction(200.0))
    near, far = (points_per_pixel(space, (POINTS,) * 3, camera_at(0.0), wall(d)) for d in (40, 80))
    assert far == pytest.approx(near, rel=0.05)


def scale(camera, depth, config=WANTED, points=POINTS):
    return lattice_scale(BOX, (points,) * 3, [camera], [depth], config)


def test_twice_the_pixels_need_twice_the_points():
    camera = camera_at(0.6)
    twice = resized(camera, 128, 96)
    fine = scale(twice, np.full((96, 128), 0.6, np.float32))
    assert fine == pytest.approx(2 * scale(camera, wall(0.6)))


def test_a_lattice_twice_as_fine_needs_half_the_scale():
    fine = scale(camera_at(0.4), wall(0.4), points=2 * POINTS - 1)
    assert fine == pytest.approx(scale(camera_at(0.4), wall(0.4)) / 2)


def test_the_scale_stays_in_its_range():
    assert scale(camera_at(5.0), wall(5.0)) == WANTED.min_scale
    assert scale(camera_at(1.0), wall(0.001)) == WANTED.max_scale


@pytest.mark.parametrize(
    ("distance", "expected"), [(0.8, 1.5), (1.28, 1.1 / 0.8), (1.76, 1.0), (5.0, 1.0)]
)
def test_a_scale_above_one_gives_a_pixel_no_more_than_the_most_points(distance, expected):
    """At a distance of 1 a pixel has 0.625 points."""
    config = replace(WANTED, min_scale=1.5, most_points_per_px=1.1)
    assert scale(camera_at(distance), wall(distance), config) == pytest.approx(expected)


def test_a_quarter_of_the_surface_may_be_nearer():
    mostly_far = wall(0.6)
    mostly_far[:8] = 0.1
    assert scale(camera_at(0.6), mostly_far) == pytest.approx(scale(camera_at(0.6), wall(0.6)))
    every = replace(WANTED, share=0.0)
    assert scale(camera_at(0.6), mostly_far, every) == WANTED.max_scale


def test_views_of_nothing_get_the_smallest_scale():
    assert scale(camera_at(1.0), wall(np.inf)) == WANTED.min_scale


@pytest.mark.parametrize(
    "wrong",
    [
        {"points_per_px": 0.0},
        {"points_per_px": np.nan},
        {"share": 2.0},
        {"max_scale": 0.5},
        {"min_scale": 0.0},
        {"most_points_per_px": 0.5},
        {"most_points_per_px": np.nan},
    ],
)
def test_settings_that_mean_nothing_are_refused(wrong):
    with pytest.raises(ValueError, match="{}={}".format(*next(iter(wrong.items())))):
        StyleLatticeConfig(**wrong)


@pytest.mark.parametrize("wrong", [-1.0, np.inf, np.nan])
def test_a_scale_that_no_lattice_has_is_refused(wrong):
    with pytest.raises(ValueError, match="appearance_scale"):
        StylizationConfig(appearance_scale=wrong)
