"""Captures of several kinds, and their scene models."""

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

from styletrf.scene.scene_model import SceneModelConfig, decide_scene_model

CAPTURES = {
    "forward": lambda: (forward_cameras(), points_before(forward_cameras())),
    "ring": lambda: (arc(25), points_of("block")),
    "arc": lambda: (arc(25, 120), points_of("block")),
    "room": lambda: (room(10), points_of("room")),
    "walk": lambda: (walk(), 3 * points_of("block")),
    "way": lambda: (walk(closed=False), 3 * points_of("block")),
    "plain": lambda: (nadir("any"), points_of("plain")),
}


def modeled(capture: str):
    """The capture's views in the normalized world, and the model."""
    cameras, points = CAPTURES[capture]()
    model = decide_scene_model(cameras, points, SceneModelConfig())
    return model.normalized(cameras), model


def centers_of(cameras) -> np.ndarray:
    return np.stack([camera.center_world for camera in cameras])
