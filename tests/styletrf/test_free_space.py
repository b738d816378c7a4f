"""What photographs look through is free, what they show is not."""

import numpy as np
import pytest
from captures import points_of, room, walk
from test_space import forward_cameras, orbit_cameras, points_before

from styletrf.cameras import project
from styletrf.free_space import CELLS, free_space
from styletrf.point_table import SparsePoints
from styletrf.scene_model import SceneModelConfig, decide_scene_model

CAPTURES = {
    "box": lambda: (orbit_cameras(), points_before(orbit_cameras())),
    "unbounded": lambda: (walk(), 6 * points_of("block")),
    "room": lambda: (room(0), points_of("room")),
}


def seen(cameras, points: np.ndarray) -> SparsePoints:
    """Every point in every view that has it in its image."""
    rows = []
    for k, camera in enumerate(cameras):
        pixels, depth = project(camera, points)
        inside = (depth > 0) & (pixels > 0).all(1) & (pixels < [camera.width, camera.height]).all(1)
        rows += [(p, k, *pixels[p]) for p in np.flatnonzero(inside)]
    table = np.array(sorted(rows))
    of = table[:, :2].astype(np.int64)
    n = len(points)
    return SparsePoints(
        points, np.zeros((n, 3), np.uint8), np.zeros(n), of[:, 0], of[:, 1], table[:, 2:]
    )


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
