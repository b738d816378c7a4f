import tracemalloc
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from styletrf.capture.poses.given_poses import GivenView, Lens
from styletrf.capture.views import (
    FEW_VIEWS,
    HOLD_OUT_EVERY,
    held_out_names,
    places_of,
    split_sources,
    split_views,
)
from styletrf.geometry.cameras import Camera


@given(st.integers(3, 300))
def test_a_split_holds_out_every_eighth_view_and_of_few_one_that_others_surround(n_views):
    fitted, held_out = split_views(n_views)
    assert sorted([*fitted, *held_out]) == list(range(n_views))
    if n_views < FEW_VIEWS:
        assert len(held_out) == 1
        assert 0 < held_out[0] < n_views - 1
    else:
        assert held_out == list(range(0, n_views, HOLD_OUT_EVERY))


def test_of_no_views_none_is_held_out():
    assert split_views(0) == ([], [])


@given(st.integers(0, 300))
def test_views_of_a_source_each_are_split_as_views(n_views):
    assert split_sources(range(n_views)) == split_views(n_views)


@given(st.lists(st.integers(0, 20), min_size=1, max_size=100))
def test_views_of_one_source_are_never_split(sources):
    fitted, held_out = split_sources(sources)
    assert sorted([*fitted, *held_out]) == list(range(len(sources)))
    assert not {sources[k] for k in fitted} & {sources[k] for k in held_out}


def views_from(centers):
    poses = [np.column_stack([np.eye(3), center]) for center in centers]
    return [Camera("", 4, 3, 4.0, 4.0, 2.0, 1.5, pose) for pose in poses]


def test_views_that_share_a_center_up_to_rounding_are_of_one_place():
    centers = [[0.1, 2, 3], [0.1 + 1e-14, 2, 3], [0.1, 2, 3.001], [9, 9, 9], [0.1, 2, 3]]
    cameras = views_from(centers)
    assert places_of(cameras) == [0, 0, 1, 2, 0]
    assert places_of(cameras[:1]) == [0]
    assert places_of([]) == []


@given(st.lists(st.sampled_from([0, 1e-10, 0.9e-9, 1.1e-9, 2e-9, 0.5, 1]), min_size=1))
def test_a_view_is_of_the_place_of_the_first_view_within_a_billionth_of_the_extent(along):
    """The matrix of all distances says the same, and takes memory that grows with its square."""
    centers = np.outer(along, [0.6, 0.0, 0.8])
    apart = np.linalg.norm(centers[:, None] - centers, axis=-1)
    first = (apart <= 1e-9 * apart.max()).argmax(axis=1)
    numbers = np.unique(first, return_inverse=True)[1]
    assert places_of(views_from(centers)) == numbers.tolist()


def test_places_of_many_views_take_memory_that_grows_with_their_number():
    def peak_bytes(count):
        cameras = views_from(np.random.default_rng(0).random((count, 3)))
        tracemalloc.start()
        places_of(cameras)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    assert peak_bytes(800) < 5 * peak_bytes(200)  # and not 16 times


@given(st.integers(3, 30), st.integers(1, 29), st.integers(0, 29))
def test_a_published_split_is_kept_as_far_as_its_views_are_placed(total, tested, placed):
    """Where none was, nothing was held out, and measures failed after the whole fit."""
    poses = [np.eye(3, 4)] * total
    lens = Lens("PINHOLE", (4.0, 4.0, 2.0, 1.5), 4, 3)
    views = {
        str(k): GivenView(Path(str(k)), lens, pose, held_out=k < tested)
        for k, pose in enumerate(poses)
    }
    cameras = [Camera(name, 4, 3, 4.0, 4.0, 2.0, 1.5, np.eye(3, 4)) for name in views]
    cameras = cameras[min(placed, total - 3) :]
    published = {camera.name for camera in cameras if int(camera.name) < tested}
    usual = {cameras[row].name for row in split_views(len(cameras))[1]}
    assert held_out_names(cameras, views) == (published or usual)
