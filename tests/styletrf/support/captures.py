"""Captures of several kinds, with the points that were seen; gravity along +y."""

import numpy as np

from styletrf.geometry.cameras import Camera, project
from styletrf.geometry.point_table import SparsePoints
from styletrf.trajectory.trajectories import look_at

GRAVITY = np.array([0.0, 1.0, 0.0])


def looking(center, target, rng=None, down=GRAVITY) -> Camera:
    """A camera held level, but for a roll of about a degree with `rng`."""
    if rng is not None:
        down = down + rng.normal(0, 0.02, 3)
    return Camera("c", 60, 45, 50.0, 50.0, 30.0, 22.5, look_at(center, target, down))


def arc(tilt_deg: float, extent_deg: float = 360.0, n: int = 40, seed: int = 0) -> list[Camera]:
    """A hand-held walk around the origin, looking down at it by `tilt_deg`."""
    rng = np.random.default_rng(seed)
    angles = np.radians(extent_deg * (np.arange(n) / n - 0.5))
    height = np.full(n, -3 * np.tan(np.radians(tilt_deg)))
    centers = np.column_stack([3 * np.sin(angles), height, 3 * np.cos(angles)])
    centers += rng.normal(0, 0.05, (n, 3))
    return [looking(center, rng.normal(0, 0.05, 3), rng) for center in centers]


def walk(n: int = 48, *, closed: bool = True) -> list[Camera]:
    """A walk around or along, looking ahead and aside by turns."""
    turn = (2 if closed else 1) * np.pi * np.arange(n) / n
    centers = np.column_stack([2 * np.cos(turn), 0 * turn, 3 * np.sin(turn)])
    heading = turn + np.pi / 2 + 0.5 * np.sin(3 * turn)
    ahead = np.column_stack([np.cos(heading), 0 * turn, np.sin(heading)])
    return [looking(center, center + to) for center, to in zip(centers, ahead, strict=True)]


def room(tilt_deg: float, n: int = 30) -> list[Camera]:
    """A walk in a circle in the middle of a room, looking at its walls."""
    outwards = np.column_stack([np.sin(a := 2 * np.pi * np.arange(n) / n), 0 * a, np.cos(a)])
    down = np.tan(np.radians(tilt_deg)) * GRAVITY
    return [looking(0.3 * out, 1.3 * out + down) for out in outwards]


def nadir(yaw: str) -> list[Camera]:
    """A drone over a plain, looking straight down from a flat grid of 6 x 6."""
    rng = np.random.default_rng(0)
    cameras = []
    for k, (i, j) in enumerate(np.ndindex(6, 6)):
        angle = {"same": 0.0, "serpentine": np.pi * (i % 2), "any": rng.uniform(0, 2 * np.pi)}[yaw]
        center = np.array([0.8 * i, -1.0, 0.8 * j]) + (k % 3) * 0.01
        image_down = np.array([np.sin(angle), 0, np.cos(angle)])
        cameras.append(looking(center, center + GRAVITY, down=image_down))
    return cameras


def points_of(kind: str) -> np.ndarray:
    """Sparse points of what the captures of a kind see."""
    rng = np.random.default_rng(1)
    if kind == "room":
        angles = rng.uniform(0, 2 * np.pi, 600)
        return np.column_stack([4 * np.sin(angles), rng.uniform(-1, 1.5, 600), 4 * np.cos(angles)])
    if kind == "plain":
        return rng.uniform([-0.5, -0.2, -0.5], [4.5, 0, 4.5], (600, 3))
    return rng.uniform(-1, 1, (600, 3))


def forward_cameras(n: int = 9, scale: float = 1.0) -> list[Camera]:
    """Looking at one place, from near each other."""
    rng = np.random.default_rng(0)
    centers = scale * np.column_stack([rng.uniform(-0.5, 0.5, (n, 2)), rng.uniform(-0.1, 0.1, n)])
    target = scale * np.array([0.0, 0.0, 4.0])
    return [
        Camera(f"{k}", 60, 40, 50.0, 50.0, 30.0, 20.0, look_at(center, target, GRAVITY))
        for k, center in enumerate(centers)
    ]


def orbit_cameras(n: int = 12, scale: float = 1.0) -> list[Camera]:
    """Around the origin, from above it."""
    angles = 2 * np.pi * np.arange(n) / n
    centers = scale * np.column_stack([3 * np.sin(angles), -np.ones(n), 3 * np.cos(angles)])
    return [
        Camera(f"{k}", 60, 40, 50.0, 50.0, 30.0, 20.0, look_at(center, np.zeros(3), GRAVITY))
        for k, center in enumerate(centers)
    ]


def points_before(cameras, scale=1.0):
    """Sparse points of what such cameras see."""
    rng = np.random.default_rng(1)
    forward = (
        cameras[0].forward_world[2] > 0.5 and len({c.forward_world[2] > 0 for c in cameras}) == 1
    )
    if forward:
        return scale * np.column_stack([rng.uniform(-2, 2, (300, 2)), rng.uniform(2, 8, 300)])
    return scale * rng.uniform(-1, 1, (300, 3))


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
