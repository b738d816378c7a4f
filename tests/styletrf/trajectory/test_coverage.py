"""Few views that show everything; what is hidden does not count as shown."""

import math
from itertools import repeat

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from styletrf.geometry.cameras import Camera, project
from styletrf.trajectory.coverage import CoverageConfig, covering, covering_once, places_seen, shown


def camera(x: float = 0.0) -> Camera:
    return Camera("c", 32, 24, 32.0, 32.0, 16.0, 12.0, np.column_stack([np.eye(3), [x, 0, 0]]))


def test_the_fewest_views_that_show_everything():
    seen = np.zeros((5, 40), dtype=bool)
    seen[0, :20], seen[3, 20:] = True, True
    seen[1, 5:25], seen[2, :10], seen[4, 30:] = True, True, True
    assert covering(seen, CoverageConfig(times=1, share=1.0)) == [0, 3]


@pytest.mark.parametrize("times", [1, 2, 4, 9])
def test_each_place_is_shown_as_often_as_asked_or_as_can_be(times):
    seen = np.random.default_rng(0).random((12, 300)) < 0.4
    chosen = covering(seen, CoverageConfig(times=times, share=1.0))
    assert (seen[chosen].sum(axis=0) >= np.minimum(seen.sum(axis=0), times)).all()
    assert len(chosen) == len(set(chosen))
    fewer = covering(seen, CoverageConfig(times=times, share=0.8))
    assert len(fewer) <= len(chosen)


@pytest.mark.parametrize("count", [1, 5, 12, 99])
def test_a_count_that_is_set_is_the_number_of_views(count):
    seen = np.random.default_rng(0).random((12, 30)) < 0.4
    assert len(covering(seen, CoverageConfig(count=count))) == min(count, 12)


def test_views_beyond_the_cover_are_spread_by_what_they_show():
    """Each place is shown once by all that are chosen before any is shown twice."""
    seen = np.repeat(np.eye(7, dtype=bool), 2, axis=0)
    chosen = covering(seen, CoverageConfig(count=7, times=1))
    assert sorted(k // 2 for k in chosen) == list(range(7))
    shown_first = np.ones((1, 7), dtype=bool)
    chosen = covering(np.concatenate([shown_first, seen]), CoverageConfig(count=8, times=1))
    assert sorted((k - 1) // 2 for k in chosen if k) == list(range(7))


@pytest.mark.parametrize("share", [0.3, 0.9, 1.0])
def test_views_are_added_until_one_at_least_shows_nearly_every_place(share):
    seen = np.random.default_rng(0).random((30, 400)) < 0.1
    first = covering(seen, CoverageConfig(count=2))
    chosen = covering_once(seen, first, CoverageConfig(once=share))
    total = seen.any(axis=0).sum()
    assert set(first) <= set(chosen)
    assert seen[chosen].any(axis=0).sum() >= share * total
    added = [k for k in chosen if k not in first]
    if added:
        assert min(seen[[k for k in chosen if k != last]].any(axis=0).sum() for last in added) < (
            share * total
        ), "no more views than it takes"


def test_no_view_is_added_where_the_chosen_ones_show_what_any_candidate_does():
    seen = np.zeros((3, 50), dtype=bool)
    seen[0, :40], seen[1, :30], seen[2, 20:40] = True, True, True
    assert covering_once(seen, [0], CoverageConfig(once=1.0)) == [0]


@pytest.mark.parametrize("places", [0, 10])
def test_where_nothing_is_seen_one_view_is_left(places):
    assert len(covering(np.zeros((4, places), dtype=bool), CoverageConfig())) == 1


def test_a_view_shows_what_it_saw_and_not_what_is_behind():
    wall = np.full((24, 32), 4.0)
    wall[:, 16:] = np.inf
    places = places_seen([camera()], [wall])
    assert len(places) == wall.size / 2
    assert shown(camera(), wall, places, 0.01).all()
    nearer = np.full((24, 32), 2.0)
    assert not shown(camera(), nearer, places, 0.01).any(), "a nearer wall hides them"
    assert not shown(camera(9.0), np.full((24, 32), 4.0), places, 0.01).any(), "beside the view"
    assert not shown(camera(), np.full((24, 32), np.inf), places, 0.01).any()


@pytest.mark.parametrize("count", [1, 30, 100, 120, 480])
@pytest.mark.parametrize("size", [(1000, 750), (1000, 667), (400, 400), (750, 1000), (1920, 1080)])
def test_places_along_a_path_are_spread_evenly_over_its_frames(size, count):
    """Every n-th pixel, row by row, lies in few columns where n and the width have factors."""
    width, height = size
    pose = camera().world_from_camera
    view = Camera("c", width, height, 1000.0, 1000.0, width / 2, height / 2, pose)
    wall = np.broadcast_to(np.float32(4.0), (height, width))
    apart_px = math.sqrt(width * height * count / 20_000)
    places = places_seen([view] * count, repeat(wall, count), apart_px)
    assert len(places) == pytest.approx(20_000, rel=0.03)
    pixels = project(view, places)[0]
    shares = np.histogram2d(*pixels.T, bins=8, range=[(0, width), (0, height)])[0] / len(places)
    np.testing.assert_allclose(shares, 1 / 64, rtol=0.3)
    assert (pixels.min(axis=0) < 0.02 * np.array(size)).all(), "from edge"
    assert (pixels.max(axis=0) > 0.98 * np.array(size)).all(), "to edge"


def test_the_edge_of_what_hides_a_place_hides_nothing_within_reach():
    wall, post = np.full((24, 32), 4.0), np.full((24, 32), 4.0)
    post[:, 10] = 1.0
    places = places_seen([camera()], [wall])
    hidden = ~shown(camera(), post, places, 0.01)
    assert hidden.sum() == 24, "the column behind the post"
    assert shown(camera(), post, places, 0.01, reach_px=1).all()
    post[:, 4:20] = 1.0
    hidden = ~shown(camera(), post, places, 0.01, reach_px=1)
    assert hidden.sum() == 24 * 14, "all but one column at each side"


@given(
    depth=arrays(np.float32, (6, 8), elements=st.floats(0.5, 9, width=32)),
    reach=st.integers(0, 3),
)
def test_a_wider_reach_shows_no_less(depth, reach):
    small = camera()
    small = Camera("c", 8, 6, 8.0, 8.0, 4.0, 3.0, small.world_from_camera)
    places = places_seen([small], [depth[::-1, ::-1].copy()])
    narrow = shown(small, depth, places, 0.05, reach)
    assert (shown(small, depth, places, 0.05, reach + 1) >= narrow).all()
