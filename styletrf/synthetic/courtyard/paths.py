"""The camera poses of each kind of capture."""

import numpy as np
from jaxtyping import Float

from styletrf.synthetic.courtyard.mesh import unit

Points = Float[np.ndarray, "views 3"]
Poses = Float[np.ndarray, "views 3 4"]


def forward_poses(n_views: int, rng: np.random.Generator) -> Poses:
    """Returns world_from_camera of a hand-held phone held about still towards the back wall.

    The centers fill an ellipse of 1.3 x 0.7 m (Vogel's spiral, jittered), as for a light field.
    """
    index = np.arange(n_views)
    radius, angle = np.sqrt((index + 0.5) / n_views), index * np.pi * (3 - np.sqrt(5))
    x, z = 0.65 * radius * np.cos(angle), 0.35 * radius * np.sin(angle)
    centers = np.stack([x, np.full(n_views, -4.3), 1.62 + z], axis=-1)
    centers += rng.normal(0, [0.02, 0.05, 0.02], (n_views, 3))
    targets = np.array([0.15, 3.6, 1.02]) + rng.normal(0, [0.12, 0, 0.1], (n_views, 3))
    return looking_at(centers, targets, rng)


def orbit_poses(n_views: int, rng: np.random.Generator) -> Poses:
    """Returns world_from_camera of a walk around the pedestal, rising and sinking."""
    angle = 2 * np.pi * (np.arange(n_views) + rng.uniform(-0.2, 0.2, n_views)) / n_views
    height = 1.75 + 0.25 * np.sin(3 * angle) + rng.normal(0, 0.03, n_views)
    centers = np.stack([2.05 * np.cos(angle), 2.05 * np.sin(angle), height], axis=-1)
    targets = np.array([0.0, 0.0, 0.85]) + rng.normal(0, 0.05, (n_views, 3))
    return looking_at(centers, targets, rng)


def walk_poses(n_views: int, rng: np.random.Generator) -> Poses:
    """Returns world_from_camera of a walk through the courtyard, past the pedestal and back.

    It goes along an ellipse, looking ahead and across the courtyard by turns.
    """
    turn = 2 * np.pi * (np.arange(n_views) + rng.uniform(-0.2, 0.2, n_views)) / n_views
    x, y = 1.9 * np.cos(turn), 2.0 * np.sin(turn) - 0.9
    bob = 0.03 * np.sin(9 * turn) + rng.normal(0, 0.015, n_views)
    centers = np.stack([x, y, 1.62 + bob], axis=-1)
    heading = turn + np.pi / 2 + np.radians(30 + 35 * np.sin(3 * turn))
    rise = np.radians(3 + 5 * np.sin(4 * turn + 1))
    ahead = np.stack([np.cos(heading), np.sin(heading), np.tan(rise)], axis=-1)
    return looking_at(centers, centers + ahead, rng)


def looking_at(centers: Points, targets: Points, rng: np.random.Generator) -> Poses:
    """Returns level poses looking at targets, but for a roll of about a degree."""
    forward = unit(targets - centers)
    level = unit(np.cross(forward, [0.0, 0.0, 1.0]))
    down = np.cross(forward, level)
    roll = rng.normal(0, np.radians(1.0), (len(centers), 1))
    right = np.cos(roll) * level + np.sin(roll) * down
    return np.stack([right, np.cross(forward, right), forward, centers], axis=-1)
