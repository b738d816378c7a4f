"""Captures of several kinds, and their scene models."""

from functools import cache

import numpy as np
from captures import (
    arc,
    forward_cameras,
    nadir,
    points_before,
    points_of,
    room,
    walk,
)

from styletrf.geometry.cameras import Camera, moved
from styletrf.scene.scene_model import SceneModel, SceneModelConfig, decide_scene_model

CAPTURES = {
    "forward": lambda: (forward_cameras(), points_before(forward_cameras())),
    "ring": lambda: (arc(25), points_of("block")),
    "arc": lambda: (arc(25, 120), points_of("block")),
    "room": lambda: (room(10), points_of("room")),
    "walk": lambda: (walk(), 3 * points_of("block")),
    "way": lambda: (walk(closed=False), 3 * points_of("block")),
    "plain": lambda: (nadir("any"), points_of("plain")),
}


@cache
def modeled(capture: str, size: float = 1.0) -> tuple[list[Camera], SceneModel]:
    """The capture's views in the normalized world, and the model, in a world so large."""
    cameras, points = CAPTURES[capture]()
    resized = [moved(camera, np.diag([size, size, size, 1.0])) for camera in cameras]
    model = decide_scene_model(resized, size * points, SceneModelConfig())
    return model.normalized(resized), model


def centers_of(cameras) -> np.ndarray:
    return np.stack([camera.center_world for camera in cameras])
