"""What photographs look through is free, what they show is not."""

import numpy as np
import pytest
from captures import (
    GRAVITY,
    forward_cameras,
    looking,
    orbit_cameras,
    points_before,
    points_of,
    room,
    seen,
    walk,
)

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


@pytest.mark.parametrize(("apart", "is_any_free"), [(0.0, False), (0.2, True)])
def test_two_views_prove_space_free_only_from_two_places(apart, is_any_free):
    """Both views of a panorama are deceived by the same point that lies too far."""
    cameras, points = CAPTURES["room"]()
    model = decide_scene_model(cameras, points, SceneModelConfig(space="box"))
    center, ahead = cameras[0].center_world, cameras[0].forward_world
    aside = np.cross(ahead, GRAVITY)
    moved = center + apart * aside
    views = [looking(center, center + ahead), looking(moved, moved + ahead + 0.3 * aside)]
    assert free_space(model, views, seen(views, points)).any() == is_any_free


def test_a_frustum_begins_before_all_cameras_and_nothing_of_it_is_taken_for_free():
    """The courtyard's railing was: half a decibel."""
    cameras, points = forward_cameras(), points_before(forward_cameras())
    model = decide_scene_model(cameras, points, SceneModelConfig(space="ndc"))
    assert not free_space(model, cameras, seen(cameras, points)).any()
