"""Every surface point has one owner: a view that shows it, or an earlier one that does."""

import numpy as np
import pytest

from styletrf.geometry.cameras import Camera
from styletrf.stylization.surface_ownership import (
    OwnershipConfig,
    farthest_first,
    is_shown,
    owned_pixels,
)

SIZE = 40
EXACT = OwnershipConfig(tolerance=0.02, smallest=0.0)


def camera(x: float) -> Camera:
    """Looks along z from (x, 0, 0); 40 pixels see 1 unit of the plane z = 1."""
    pose = np.eye(4)[:3]
    pose[0, 3] = x
    focal_px = float(SIZE)
    return Camera(f"{x}", SIZE, SIZE, focal_px, focal_px, SIZE / 2, SIZE / 2, pose)


def plane(depth: float) -> np.ndarray:
    return np.full((SIZE, SIZE), depth, dtype=np.float32)


def test_one_view_owns_all_that_it_shows():
    assert owned_pixels([camera(0)], [plane(2)], EXACT)[0].all()


def test_of_two_equal_views_the_second_owns_nothing():
    first, second = owned_pixels([camera(0), camera(0)], [plane(2)] * 2, EXACT)
    assert first.all()
    assert not second.any()


def test_a_view_owns_what_lies_beyond_the_border_of_an_earlier_one():
    """Of the plane z = 1 a camera moved by a quarter of its view shows a quarter more."""
    masks = owned_pixels([camera(0), camera(0), camera(0.25)], [plane(1)] * 3, EXACT)
    assert masks[2][:, :29].sum() == 0
    assert masks[2][:, 31:].all()


def test_what_an_earlier_view_hides_is_owned_by_one_that_shows_it():
    """A post at depth 1 hides a strip of the wall at depth 4, which moves by less than the post."""
    wall, post = plane(4), plane(4)
    post[:, 18:22] = 1
    beside = plane(4)
    beside[:, 8:12] = 1  # the same post, 10 pixels to the left: its parallax at depth 1
    cameras = [camera(0), camera(0), camera(0.25)]
    masks = owned_pixels(cameras, [post, post, beside], EXACT)
    shifted = 0.25 * SIZE / 4  # of the wall
    hidden = masks[2][5, round(18 - shifted) + 1 : round(22 - shifted) - 1]
    assert hidden.all()
    assert not masks[2][5, 9:11].any(), "the post itself is shown by the first view"
    assert not owned_pixels(cameras, [wall] * 3, EXACT)[2][5, 3:25].any()


@pytest.mark.parametrize("depth", [1e-3, 1.0, 1e5, np.inf])
def test_any_depth_is_owned_by_someone(depth):
    cameras = [camera(x) for x in (-0.1, 0.0, 0.1)]
    masks = owned_pixels(cameras, [plane(depth)] * 3, EXACT)
    assert masks[farthest_first(cameras)[0]].all()


def test_regions_that_are_too_small_own_nothing():
    moved = [camera(0), camera(0), camera(0.025)]  # by one column
    some = owned_pixels(moved, [plane(1)] * 3, OwnershipConfig(tolerance=0.01, smallest=0.0))
    none = owned_pixels(moved, [plane(1)] * 3, OwnershipConfig(tolerance=0.01, smallest=0.1))
    assert some[2].any()
    assert not none[2].any()


def test_showing_the_same_is_symmetric_on_a_plane():
    cameras, depths = (camera(0), camera(0.1)), (plane(2), plane(2))
    pixels = np.arange(SIZE * SIZE)
    there = is_shown(cameras, depths, pixels, 0.5)
    back = is_shown((cameras[1], cameras[0]), depths, pixels, 0.5)
    assert there.mean() == back.mean() < 1


def test_each_next_view_is_the_farthest_from_those_before():
    cameras = [camera(x) for x in (0.0, 1.0, 2.0, 10.0, 4.0)]
    order = farthest_first(cameras)
    assert order[:2] == [4, 3]  # 4 is nearest to the mean of 3.4, then 10 is the farthest
    assert sorted(order) == [0, 1, 2, 3, 4]


def test_impossible_tolerances_are_refused():
    with pytest.raises(ValueError, match=r"tolerance=0\.0"):
        OwnershipConfig(tolerance=0.0)
