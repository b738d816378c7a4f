"""The visual hull of a ball is the ball, a little more between the views, and never less."""

import numpy as np
import pytest

from styletrf.cameras import Camera, pixel_centers
from styletrf.errors import InputError
from styletrf.trajectories import look_at
from styletrf.visual_hull import extremes_of_hull

SIZE, RADIUS = 64, 0.7
CENTER = np.array([0.3, -0.2, 0.1])


def cameras() -> list[Camera]:
    rng = np.random.default_rng(0)
    places = rng.normal(size=(24, 3))
    places = CENTER + 4 * places / np.linalg.norm(places, axis=1, keepdims=True)
    half = SIZE / 2
    poses = [look_at(place, CENTER, np.array([0.0, 1.0, 0.1])) for place in places]
    return [Camera(f"{k}", SIZE, SIZE, 80.0, 80.0, half, half, p) for k, p in enumerate(poses)]


def silhouette(camera: Camera) -> np.ndarray:
    x, y = ((pixel_centers(SIZE, SIZE) - SIZE / 2) / 80).T
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ camera.world_from_camera[:, :3].T
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    across = np.cross(rays, CENTER - camera.center_world)
    return (np.linalg.norm(across, axis=1) < RADIUS).reshape(SIZE, SIZE)


def test_the_hull_of_a_ball_is_the_ball():
    views = cameras()
    extremes = extremes_of_hull(views, [silhouette(view) for view in views])
    distance = np.linalg.norm(extremes - CENTER, axis=1)
    assert distance.min() > 0.93 * RADIUS
    assert distance.max() < 1.25 * RADIUS


def test_silhouettes_of_nothing_are_told():
    views = cameras()
    with pytest.raises(InputError, match="have nothing in common"):
        extremes_of_hull(views, [np.zeros((SIZE, SIZE), dtype=bool)] * len(views))
