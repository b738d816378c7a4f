"""What photographs look through is free, what they show is not."""

import numpy as np
import pytest
from captures import forward_cameras, orbit_cameras, points_before, points_of, room, seen, walk

from styletrf.scene.free_space import CELLS, free_space
from styletrf.scene.scene_model import SceneModelConfig, decide_scene_model

CAPTURES = {
    "box": lambda: (orbit_cameras(), points_before(orbit_cameras())),
    "unbounded": lambda: (walk(), 6 * points_of("block")),
    "room": lambda: (room(0), points_of("room")),
}


def cells_of(model, points: np.ndarray) -> np.ndarray:
    matrix = model.normalized_from_world
    grid = model.space.to_grid(points @ matrix[:3, :3].T + matrix[:3, 3])
    grid = grid[(np.abs(grid) < 1).all(axis=1)]
    return ((grid + 1) / 2 * CELLS).astype(int)


@pytest.mark.parametrize("capture", CAPTURES)
def test_cells_with_points_are_not_free_and_some_before_them_are(capture):
    cameras, points = CAPTURES[capture]()
    kind = capture if capture != "room" else "box"
    model = decide_scene_model(cameras, points, SceneModelConfig(space=kind))
    free = free_space(model, cameras, seen(cameras, points))
    shown = np.concatenate([points[p][None] for p in set(seen(cameras, points).observed_point)])
    assert not free[tuple(cells_of(model, shown).T)].any()
    assert free.any()


def test_what_one_photograph_alone_looks_through_and_what_none_shows_may_be_anything():
    cameras, points = CAPTURES["room"]()
    model = decide_scene_model(cameras, points, SceneModelConfig(space="box"))
    tracks = seen(cameras[:1], points)
    assert not free_space(model, cameras, tracks).any()


def test_a_frustum_begins_before_all_cameras_and_nothing_of_it_is_taken_for_free():
    """The courtyard's railing was: half a decibel."""
    cameras, points = forward_cameras(), points_before(forward_cameras())
    model = decide_scene_model(cameras, points, SceneModelConfig(space="ndc"))
    assert not free_space(model, cameras, seen(cameras, points)).any()
