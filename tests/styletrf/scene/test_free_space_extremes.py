"""Free space at any scale of the world."""

from dataclasses import replace

import numpy as np
import pytest
from captures import points_of, room, seen

from styletrf.geometry.cameras import moved
from styletrf.scene.free_space import free_space
from styletrf.scene.scene_model import SceneModelConfig, decide_scene_model

FREE = pytest.mark.extremes("Free space")


def free_of_room(scale: float) -> np.ndarray:
    """Returns the free cells of a room, its world scaled."""
    cameras, points = room(0), points_of("room")
    tracks = seen(cameras, points)
    similarity = np.diag([scale, scale, scale, 1.0])
    larger = [moved(camera, similarity) for camera in cameras]
    model = decide_scene_model(larger, scale * points, SceneModelConfig(space="box"))
    return free_space(model, larger, replace(tracks, xyz_world=scale * points))


@pytest.fixture(scope="module")
def exact() -> float:
    """The free share of the room at its own scale."""
    return float(free_of_room(1.0).mean())


@FREE
@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e3, 1e9])
def test_what_is_free_does_not_depend_on_the_scale_of_the_world(scale, exact, stability):
    """But for cells whose middle lies on a border, by rounding."""
    found = free_of_room(scale).mean()
    assert 0.01 < exact < 0.99
    stability(f"free share, world of scale {scale:g}", found, exact, within=1e-4)
