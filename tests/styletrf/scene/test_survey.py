"""What a survey finds in photographs that were made to have it, and only there."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from styletrf.geometry.cameras import Camera, project
from styletrf.geometry.point_table import SparsePoints
from styletrf.geometry.space import Space
from styletrf.scene.survey import survey_scene
from styletrf.trajectory.trajectories import look_at

SIZE, N_VIEWS, FOCAL = 96, 9, 96.0
BOX = Space("box", np.eye(4)[None], (1.0, 1.0, 1.0), 0.01)
DOWN = np.array([0.0, 1.0, 0.0])


def ring(n: int = N_VIEWS) -> list[Camera]:
    """Cameras around the box, each of which sees all of it."""
    cameras = []
    for k in range(n):
        angle = 2 * np.pi * k / n
        pose = look_at(4 * np.array([np.sin(angle), 0.1, np.cos(angle)]), np.zeros(3), DOWN)
        cameras.append(Camera(f"view{k}", SIZE, SIZE, FOCAL, FOCAL, SIZE / 2, SIZE / 2, pose))
    return cameras


def speckled(cameras: list[Camera], stops: np.ndarray) -> tuple[list[np.ndarray], SparsePoints]:
    """Photographs of bright and dark spots, each exposed by some stops, and the spots' tracks."""
    rng = np.random.default_rng(0)
    xyz, light = rng.uniform(-0.7, 0.7, (150, 3)), rng.uniform(0.1, 0.4, 150)
    images, point, image, pixels = [], [], [], []
    for k, camera in enumerate(cameras):
        shown = np.full((SIZE, SIZE), 0.02)
        at, _ = project(camera, xyz)
        for p, (x, y) in enumerate(at):
            shown[int(y) - 1 : int(y) + 2, int(x) - 1 : int(x) + 2] = light[p]
        where = at.astype(int)
        seen = np.flatnonzero(shown[where[:, 1], where[:, 0]] == light)
        encoded = (shown * 2.0 ** stops[k]) ** (1 / 2.2)
        images.append(np.repeat((255 * encoded).round().astype(np.uint8)[..., None], 3, axis=-1))
        point += seen.tolist()
        image += [k] * len(seen)
        pixels += at[seen].tolist()
    rgb = np.zeros((len(xyz), 3), np.uint8)
    return images, SparsePoints(
        xyz, rgb, np.zeros(len(xyz)), np.array(point), np.array(image), np.array(pixels)
    )


def survey(cameras, images, points):
    return survey_scene(images, points, BOX.to_grid(points.xyz_world), BOX, cameras)


def test_exposures_are_found_to_a_fraction_of_a_stop():
    stops = np.array([0, 0, 0.1, -0.1, 0, 1.0, 0, 0.05, 0])
    found = survey(ring(), *speckled(ring(), stops))
    exposure = np.array([view.exposure_ev for view in found.views])
    np.testing.assert_allclose(exposure - np.median(exposure), stops, atol=0.15)
    assert [view.name for view in found.views if view.off_exposure] == ["view5"]


def test_a_blurred_photograph_among_sharp_ones_is_found():
    images, points = speckled(ring(), np.zeros(N_VIEWS))
    images[3] = cv2.GaussianBlur(images[3], (0, 0), 2.5)
    found = survey(ring(), images, points)
    assert [view.name for view in found.views if view.blurred] == ["view3"]


@pytest.mark.parametrize("n", [1, 2, 5])
def test_photographs_that_are_all_alike_have_no_outliers(n):
    found = survey(ring(n), *speckled(ring(n), np.zeros(n)))
    assert not [view for view in found.views if view.blurred or view.off_exposure]


def test_every_view_sees_all_of_a_small_box_in_its_middle():
    found = survey(ring(), *speckled(ring(), np.zeros(N_VIEWS)))
    assert found.seen_by[6:10, 6:10, 6:10].min() == N_VIEWS
    assert found.seen_by.max() == N_VIEWS
    assert found.sparse_fraction == 0


def test_a_camera_that_looks_away_sees_nothing_of_it():
    cameras = ring()
    images, points = speckled(cameras, np.zeros(N_VIEWS))
    before = survey(cameras, images, points).seen_by
    away = look_at(np.array([0.0, 0.0, 4.0]), np.array([0.0, 0.0, 9.0]), DOWN)
    turned = [replace(cameras[0], world_from_camera=away), *cameras[1:]]
    np.testing.assert_array_equal(survey(turned, images, points).seen_by, before - 1 * (before > 0))


def test_two_views_are_fewer_than_three():
    found = survey(ring(2), *speckled(ring(2), np.zeros(2)))
    assert found.sparse_fraction == found.blind_fraction == 1


def test_points_outside_the_box_are_no_part_of_it():
    images, points = speckled(ring(), np.zeros(N_VIEWS))
    found = survey(ring(), images, replace(points, xyz_world=points.xyz_world + 50))
    assert not found.has_points.any()
    assert found.sparse_fraction == 0


def test_black_photographs_have_no_exposure_to_compare():
    images, points = speckled(ring(), np.zeros(N_VIEWS))
    found = survey(ring(), [0 * image for image in images], points)
    assert not [view for view in found.views if view.blurred or view.off_exposure]
