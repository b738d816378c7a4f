"""A photograph of a plane, and cameras that see it."""

import cv2
import numpy as np
import torch

from styletrf.field.rendering import Rendering
from styletrf.geometry.cameras import Camera, pixel_centers, points_at_depth

DEPTH = 3.0  # of the plane z = DEPTH


def camera(center=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0), name="view") -> Camera:
    rotation = cv2.Rodrigues(np.array(spin))[0]
    pose = np.column_stack([rotation, np.array(center)])
    return Camera(name, 192, 144, 180.0, 180.0, 96.0, 72.0, pose)


def plane(seed: int):
    """Returns what renders a plane that is painted with waves; `seed` decides which."""
    rng = np.random.default_rng(seed)
    waves = rng.normal(0, 1, (40, 2)) * rng.uniform(1, 12, (40, 1))
    phases, colors = rng.uniform(0, 6.28, 40), rng.uniform(-1, 1, (40, 3))

    def render(view: Camera) -> Rendering:
        pixels, shape = pixel_centers(view.width, view.height), (view.height, view.width)
        directions = points_at_depth(view, pixels, np.ones(len(pixels))) - view.center_world
        z = (DEPTH - view.center_world[2]) / directions[:, 2]
        points = points_at_depth(view, pixels, z)[:, :2]
        values = 0.5 + np.sin(points @ waves.T + phases) @ colors / 16
        depth = torch.as_tensor(z).reshape(shape)
        color = torch.as_tensor(values.clip(0, 1).reshape(*shape, 3))
        return Rendering(color, torch.ones(shape), depth, depth)

    return render


def photograph(render, view: Camera) -> np.ndarray:
    return render(view).color.numpy()
