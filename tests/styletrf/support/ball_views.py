"""A ball as cameras around it see it."""

import numpy as np
import torch

from styletrf.field.rendering import Rendering
from styletrf.geometry.cameras import Camera, pixel_centers

RADIUS, DISTANCE, SIZE = 0.6, 3.0, 64


def camera(angle_rad: float) -> Camera:
    """One that looks at the origin, from a circle about the y axis."""
    forward = np.array([-np.sin(angle_rad), 0.0, -np.cos(angle_rad)])
    down = np.array([0.0, 1.0, 0.0])
    pose = np.column_stack([np.cross(down, forward), down, forward, -DISTANCE * forward])
    return Camera(f"{angle_rad}", SIZE, SIZE, 90.0, 90.0, SIZE / 2, SIZE / 2, pose)


def ball_seen(view: Camera) -> Rendering:
    """The depth of a ball at the origin; red is on the side of +x."""
    x, y = ((pixel_centers(SIZE, SIZE) - SIZE / 2) / 90).T
    directions = np.column_stack([x, y, np.ones_like(x)]) @ view.world_from_camera[:, :3].T
    a = np.square(directions).sum(axis=1)
    b = directions @ view.center_world
    root = b * b - a * (DISTANCE**2 - RADIUS**2)
    depth = np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.inf)
    points = view.center_world + np.where(root > 0, depth, 0)[:, None] * directions
    red = (points[:, :1] > 0) * np.array([1.0, 0.0, 0.0])
    opacity = torch.from_numpy((root > 0).astype(np.float32)).reshape(SIZE, SIZE)
    depths = torch.from_numpy(depth.astype(np.float32)).reshape(SIZE, SIZE)
    color = torch.from_numpy(red.astype(np.float32)).reshape(SIZE, SIZE, 3)
    return Rendering(color, opacity, depths, depths)
