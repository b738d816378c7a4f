"""Projection, rays, resizing and the table."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from styletrf.geometry.camera_table import read_cameras, read_unregistered, write_cameras
from styletrf.geometry.cameras import (
    Camera,
    directions_camera,
    directions_of_all_pixels,
    fitted_to,
    moved,
    pixel_centers,
    points_at_depth,
    project,
    resized,
)
from styletrf.trajectory.trajectories import look_at


def camera_at(seed: int) -> Camera:
    rng = np.random.default_rng(seed)
    pose = look_at(
        rng.normal(size=3), rng.normal(size=3) + np.array([0, 0, 5.0]), np.array([0, 1.0, 0])
    )
    return Camera(f"{seed}", 64, 48, 50.0, 55.0, 31.0, 25.0, pose)


@given(st.integers(0, 1000))
def test_a_point_on_a_pixels_ray_projects_to_the_pixel(seed):
    camera, rng = camera_at(seed), np.random.default_rng(seed)
    pixels = rng.uniform(0, [64, 48], (20, 2))
    depth = rng.uniform(0.1, 100, 20)
    found, found_depth = project(camera, points_at_depth(camera, pixels, depth))
    np.testing.assert_allclose(found, pixels, atol=1e-8)
    np.testing.assert_allclose(found_depth, depth)


def test_directions_of_all_pixels_are_those_of_their_centers():
    camera = camera_at(0)
    of_centers = directions_camera(camera, pixel_centers(camera.width, camera.height))
    np.testing.assert_array_equal(directions_of_all_pixels(camera), of_centers)


def test_first_pixel_center_is_half_half():
    assert pixel_centers(3, 2)[0].tolist() == [0.5, 0.5]
    assert pixel_centers(3, 2)[3].tolist() == [0.5, 1.5]


def test_resizing_scales_the_projection():
    camera = camera_at(0)
    points = np.array([[0.1, 0.2, 4.0], [1.0, -1.0, 6.0]])
    small = resized(camera, 32, 24)
    np.testing.assert_allclose(project(small, points)[0], project(camera, points)[0] / 2)


def test_an_image_is_never_enlarged():
    assert (fitted_to(camera_at(0), 640).width, fitted_to(camera_at(0), 32).width) == (64, 32)
    assert (fitted_to(camera_at(0), 1).width, fitted_to(camera_at(0), 1).height) == (1, 1)


def test_a_similarity_of_the_world_leaves_the_image():
    camera = camera_at(3)
    rotation = look_at(np.zeros(3), np.array([1.0, 2.0, 3.0]), np.array([0, 1.0, 0]))[:, :3]
    new_from_world = np.eye(4)
    new_from_world[:3, :3], new_from_world[:3, 3] = 2.5 * rotation, [1, 2, 3]
    points = np.random.default_rng(0).normal(size=(10, 3)) + np.array([0, 0, 5])
    new_points = points @ new_from_world[:3, :3].T + new_from_world[:3, 3]
    pixels, depth = project(camera, points)
    new_pixels, new_depth = project(moved(camera, new_from_world), new_points)
    np.testing.assert_allclose(new_pixels, pixels)
    np.testing.assert_allclose(new_depth, 2.5 * depth)


def test_the_table_returns_what_it_was_given(tmp_path: Path):
    cameras = [camera_at(k) for k in range(3)]
    write_cameras(tmp_path / "cameras.parquet", cameras, ["lost"])
    found = read_cameras(tmp_path / "cameras.parquet")
    for ours, theirs in zip(found, cameras, strict=True):
        np.testing.assert_array_equal(ours.world_from_camera, theirs.world_from_camera)
        assert (ours.name, ours.fx, ours.width) == (theirs.name, theirs.fx, theirs.width)
    assert read_unregistered(tmp_path / "cameras.parquet") == ["lost"]


@pytest.mark.extremes("Cameras: lenses, projection, similarities")
def test_looking_along_down_is_still_a_rotation(stability):
    pose = look_at(np.zeros(3), np.array([0, 3.0, 0]), np.array([0, 1.0, 0]))
    stability("products of axes", pose[:, :3].T @ pose[:, :3], np.eye(3))
    stability("determinant", np.linalg.det(pose[:, :3]), 1.0)
