"""Matte spheres are found matte, shiny ones shiny, whatever the exposures."""

import numpy as np
import pytest

from styletrf.geometry.cameras import Camera, project
from styletrf.geometry.point_table import SparsePoints
from styletrf.scene.observed_colors import observed_colors
from styletrf.scene.view_dependence import ENOUGH_POINTS, view_dependence
from styletrf.trajectory.trajectories import look_at

SIZE = 96


def ring(n: int, extent_deg: float) -> list[Camera]:
    angles = np.radians(extent_deg) * (np.arange(n) / n - 0.5)
    return [
        Camera(
            f"{k}", SIZE, SIZE, 1.1 * SIZE, 1.1 * SIZE, SIZE / 2, SIZE / 2,
            look_at(3 * np.array([np.sin(a), 0, -np.cos(a)]), np.zeros(3), np.array([0, 1.0, 0])),
        )
        for k, a in enumerate(angles)
    ]  # fmt: skip


def albedo(points: np.ndarray) -> np.ndarray:
    waves = np.sin(9 * points[..., :1]) + np.sin(11 * points[..., 1:2] + 1)
    return 0.4 + 0.12 * waves * np.array([1.0, 0.8, 0.6])


def photograph(camera: Camera, shine: float, gain: float) -> np.ndarray:
    """A unit sphere with waves on it, and a headlight's highlight."""
    y, x = (np.mgrid[:SIZE, :SIZE] + 0.5 - SIZE / 2) / (1.1 * SIZE)
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ camera.world_from_camera[:, :3].T
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    along = -(rays @ camera.center_world)
    half = np.sqrt(np.maximum(along**2 - 8, 0))
    surface = camera.center_world + (along - half)[..., None] * rays
    color = albedo(surface) + shine * np.clip(-(surface * rays).sum(-1), 0, 1)[..., None] ** 12
    return np.where((half > 0)[..., None], gain * color, 0.1).clip(0, 1).astype(np.float32)


def tracks(cameras: list[Camera], n: int = 900) -> SparsePoints:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(n, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    seen = []
    for k, camera in enumerate(cameras):
        facing = (points * (camera.center_world - points)).sum(axis=1) > 0.6
        pixels, _ = project(camera, points)
        seen += [(p, k, *pixels[p]) for p in np.flatnonzero(facing)]
    table = np.array(sorted(seen))
    rows = table[:, :2].astype(np.int64)
    rgb, error = np.zeros((n, 3), np.uint8), np.zeros(n)
    return SparsePoints(points, rgb, error, rows[:, 0], rows[:, 1], table[:, 2:])


@pytest.mark.parametrize(("shine", "needed"), [(0.0, False), (0.5, True)])
def test_a_highlight_is_distinguished_from_paint_under_changing_exposures(shine, needed):
    cameras = ring(24, 180)
    gains = 1 + 0.1 * np.sin(np.arange(24))
    images = [photograph(c, shine, g) for c, g in zip(cameras, gains, strict=True)]
    points = tracks(cameras)
    found = view_dependence(observed_colors(images, points), points, cameras)
    assert found.points >= ENOUGH_POINTS
    assert found.needed == needed


def test_photographs_from_one_side_do_not_tell_and_colors_may_depend_on_the_view():
    cameras = ring(12, 10)
    images = [photograph(c, 0.0, 1.0) for c in cameras]
    points = tracks(cameras)
    found = view_dependence(observed_colors(images, points), points, cameras)
    assert found.points == 0
    assert found.needed


def test_points_that_no_two_views_share_do_not_tell():
    cameras = ring(3, 180)
    lone = SparsePoints(
        np.zeros((2, 3)), np.zeros((2, 3), np.uint8), np.zeros(2), np.array([0, 1]),
        np.array([0, 2]), np.full((2, 2), 40.0),
    )  # fmt: skip
    observed = observed_colors([photograph(c, 0, 1) for c in cameras], lone)
    assert view_dependence(observed, lone, cameras).needed
