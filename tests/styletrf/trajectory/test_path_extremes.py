"""Paths of cameras, levels of images and cut-out objects, at their extremes."""

import numpy as np
import pytest
from trajectory_captures import CAPTURES, modeled

from styletrf.files.float_images import FloatImage
from styletrf.files.images import to_integers
from styletrf.stylization.background import empty_background
from styletrf.trajectory.trajectories import fly_through, look_at, prior_views
from styletrf.trajectory.trajectory_config import TrajectoryConfig

PATHS = pytest.mark.extremes("Trajectories")
LEVELS = pytest.mark.extremes("Levels of 8 and 16 bits")
GROUND = pytest.mark.extremes("Objects on an empty ground")
DOWN = np.array([0.0, 1.0, 0.0])


@PATHS
@pytest.mark.parametrize("distance", [0.0, 1e-100, 1e-12, 1.0, 1e12, 1e100])
@pytest.mark.parametrize("tilt", [0.0, 1e-12, 1e-6, 1.0], ids="about {:g}".format)
def test_looking_at_a_point_at_any_distance_is_a_rotation(distance, tilt, stability):
    """Also straight down, and at the very place."""
    direction = np.array([np.sin(tilt), np.cos(tilt), 0.0])
    pose = look_at(np.zeros(3), distance * direction, DOWN)[:, :3]
    assert np.linalg.det(pose) == pytest.approx(1)
    if distance:
        assert pose[:, 2] == pytest.approx(direction, abs=1e-12)
    stability(f"tilt {tilt:g}, distance {distance:g}", pose.T @ pose, np.eye(3))


@PATHS
@pytest.mark.parametrize("capture", CAPTURES)
@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("path_of", [fly_through, prior_views])
def test_paths_are_the_same_at_any_scale_of_the_world(capture, scale, path_of, stability):
    def path(size):
        views = path_of(*modeled(capture, size), TrajectoryConfig(frames=12))
        return np.stack([view.world_from_camera for view in views])

    found, exact = path(scale), path(1.0)
    assert found == pytest.approx(exact, abs=1e-5)
    stability(f"{capture}, {path_of.__name__}, scale {scale:g}", found, exact)


@LEVELS
@pytest.mark.parametrize("bits", [8, 16])
def test_levels_are_the_nearest_and_stay_within_their_range(bits, stability):
    most = 2**bits - 1
    values = np.float32([-1e30, -1.0, -0.0, 1e-45, 0.5 / most, 0.5, 1 - 1e-7, 1.0, 1e30])
    image = np.repeat(values, 3).reshape(1, -1, 3)
    exact = np.rint(np.clip(image.astype(np.float64), 0, 1) * most)
    found = to_integers(image, bits)
    assert np.array_equal(found, exact)
    stability("-1e30 to 1e30", found, exact, precision="float32")


@GROUND
@pytest.mark.parametrize("opacity", [1e-2, 0.5, 1.0])
@pytest.mark.parametrize("color", [0.0, 1e-6, 1.0])
def test_the_mean_color_of_an_object_is_within_its_own(opacity, color, stability):
    """However thin it is: what shines through it is not its own."""
    alpha = np.zeros((8, 8), np.float32)
    alpha[:4] = opacity
    image = (alpha * color + (1 - alpha))[..., None].repeat(3, axis=-1).astype(np.float32)
    ground = empty_background([FloatImage(image, alpha, np.ones_like(alpha))])
    assert ground.mean == pytest.approx([color] * 3, abs=1e-4)
    case, rounding = f"opacity {opacity:g}, color {color:g}", 2.0**-23 / opacity
    stability(case, ground.mean, np.full(3, color), within=rounding, absolute=True)
