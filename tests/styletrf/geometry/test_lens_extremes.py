"""Lenses and the poses that COLMAP solves, at any focal length, distortion and size of image."""

from dataclasses import replace

import numpy as np
import pycolmap
import pytest
from captures import arc, seen

from styletrf.geometry.parallax import parallax_fraction
from styletrf.geometry.undistortion import pinhole_for, undistorted_image, undistorted_pixels
from styletrf.sfm.reconstruction import placed_photographs

UNDISTORTION = pytest.mark.extremes("Undistortion")
POSES = pytest.mark.extremes("COLMAP poses")


def lens(focal_px: float, k: float) -> pycolmap.Camera:
    params = [focal_px, 32.0, 24.0, k]
    return pycolmap.Camera(model="SIMPLE_RADIAL", width=64, height=48, params=params, camera_id=1)


@UNDISTORTION
@pytest.mark.parametrize("focal_px", [60.0, 1e3, 1e4])
@pytest.mark.parametrize("corner", [-0.1, -1e-9, 0.0, 1e-9, 0.1])
def test_an_undistorted_pixel_is_on_the_ray_of_the_lens(focal_px, corner, stability):
    """`corner` is the distortion at the corner of the image, over its distance from the middle."""
    of_image = lens(focal_px, corner / (np.hypot(32, 24) / focal_px) ** 2)
    pinhole = pinhole_for(of_image, "a", np.eye(3, 4))
    pixels = np.random.default_rng(0).uniform([0, 0], [64, 48], (200, 2))
    straight = undistorted_pixels(pixels, of_image, pinhole)
    slopes = (straight - [pinhole.cx, pinhole.cy]) / [pinhole.fx, pinhole.fy]
    back = of_image.img_from_cam(np.column_stack([slopes, np.ones(len(slopes))]))
    stability(f"focal length {focal_px:g} px, {corner:g} at the corner", back, pixels, within=1e-6)


@UNDISTORTION
@pytest.mark.parametrize("level", [0, 1, 255])
@pytest.mark.parametrize("corner", [-0.1, 0.1])
def test_an_even_photograph_stays_even_up_to_its_edges(level, corner, stability):
    of_image = lens(60.0, corner / (np.hypot(32, 24) / 60.0) ** 2)
    image = np.full((48, 64, 3), level, np.uint8)
    found = undistorted_image(image, of_image, pinhole_for(of_image, "a", np.eye(3, 4)))
    stability(f"level {level}", found.astype(np.float64), image.astype(np.float64), within=0.0)


@POSES
@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_a_pose_of_colmap_is_a_rotation_and_the_place_of_the_camera(scale, stability):
    rng, place = np.random.default_rng(0), scale * np.array([1.0, -2.0, 3.0])
    quaternion = rng.standard_normal(4)
    rotation = pycolmap.Rotation3d(quaternion / np.linalg.norm(quaternion))
    pose = pycolmap.Rigid3d(rotation, -rotation.matrix() @ place)
    model = pycolmap.Reconstruction()
    model.add_camera_with_trivial_rig(lens(60.0, 0.0))
    image = pycolmap.Image(name="a.png", camera_id=1, image_id=1)
    model.add_image_with_trivial_frame(image, pose)
    (found,) = placed_photographs(model, {"a.png": "a"})
    axes = found.camera.world_from_camera[:, :3]
    stability(f"axes, world of scale {scale:g}", axes.T @ axes, np.eye(3))
    stability(f"place, world of scale {scale:g}", found.camera.center_world, place)


@POSES
@pytest.mark.parametrize("size", [10, 1000, 1_000_000])
def test_the_parallax_does_not_depend_on_the_size_of_the_photographs(size, stability):
    """RANSAC draws the same points, so that the same are off."""
    cameras, points = arc(20, n=5), np.random.default_rng(0).uniform(-0.7, 0.7, (400, 3))
    tracks = seen(cameras, points)

    def fraction(times: int) -> float:
        larger = [replace(c, width=times * c.width, height=times * c.height) for c in cameras]
        pixels = times * tracks.observed_pixel
        return parallax_fraction(replace(tracks, observed_pixel=pixels), larger)

    stability(f"photographs {size} times as large", fraction(size), fraction(20), within=0.05)
