from dataclasses import replace

import cv2
import numpy as np
import pytest
from made_panoramas import courtyard_panoramas

from styletrf.capture.panorama.panorama_views import (
    DIRECTIONS,
    FOV_DEG,
    MOST_PX,
    cut_views,
    panorama_from_view,
    panorama_pixels,
    seen_in_panorama,
    view_camera,
)
from styletrf.geometry.cameras import Camera, in_view, pixel_centers, points_at_depth, project
from styletrf.synthetic.courtyard import CourtyardConfig, render_view

WIDTH = 720


def directions_of_pixels(width):
    """Returns the unit direction of each pixel of a panorama, height width 3."""
    longitude, below = ((pixel_centers(width, width // 2) / width - [0.5, 0.25]) * 2 * np.pi).T
    x, z = np.sin(longitude) * np.cos(below), np.cos(longitude) * np.cos(below)
    return np.stack([x, np.sin(below), z], axis=-1).reshape(width // 2, width, 3)


def painted(directions):
    """Returns colors that tell directions, 127 levels for a length of one."""
    return np.rint(127.5 + 127 * directions).astype(np.uint8)


def smooth(directions):
    """Returns colors that change slowly with the direction, and differ in all of them."""
    x, y, z = np.moveaxis(directions, -1, 0)
    waves = np.stack([np.sin(3 * x + z), np.cos(2 * y - 3 * z), np.sin(2 * x * z + y)], axis=-1)
    return np.rint(127.5 + 100 * waves).astype(np.uint8)


def rays(camera):
    """Returns the unit directions of a camera's pixels, height width 3."""
    pixels = pixel_centers(camera.width, camera.height)
    found = points_at_depth(camera, pixels, np.ones(len(pixels))) - camera.center_world
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    return found.reshape(camera.height, camera.width, 3)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_each_pixel_shows_what_lies_along_its_ray(direction):
    panorama = painted(directions_of_pixels(WIDTH))
    view = dict(cut_views(panorama))[direction]
    directions = (view.astype(float) - 127.5) / 127
    assert np.abs(directions - rays(view_camera(direction, WIDTH))).max() < 1.6 / 127


def test_a_direction_is_where_its_pixel_is():
    directions = directions_of_pixels(64).reshape(-1, 3)
    assert panorama_pixels(5.0 * directions, 64, 32) == pytest.approx(pixel_centers(64, 32))


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_views_are_turned_and_not_mirrored(direction):
    rotation = panorama_from_view(direction)
    assert rotation.T @ rotation == pytest.approx(np.eye(3))
    assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_views_around_the_horizon_are_level_and_overlap():
    for direction in DIRECTIONS[:4]:
        camera = view_camera(direction, WIDTH)
        assert camera.world_from_camera[:, 1] == pytest.approx([0, 1, 0])
        assert 2 * np.degrees(np.arctan(camera.width / 2 / camera.fx)) == pytest.approx(FOV_DEG)
        assert camera.height / camera.width == pytest.approx(3 / 4, abs=0.01)


def test_nothing_but_what_is_far_below_is_left_out():
    directions = directions_of_pixels(360).reshape(-1, 3)
    seen = np.zeros(len(directions), dtype=bool)
    for direction in DIRECTIONS:
        seen |= in_view(view_camera(direction, 4096), directions)[2]
    below_deg = np.degrees(np.arcsin(directions[:, 1]))
    assert seen[below_deg < 32].all()
    assert not seen[below_deg > 42].any()


def test_a_view_is_as_fine_as_its_panorama_and_no_larger_than_the_working_size():
    for width in (64, 2048, 4096):
        pixel_rad = 1 / view_camera("front", width).fx
        assert 0.8 * 2 * np.pi / width < pixel_rad <= 2 * np.pi / width
    assert view_camera("front", 7680).width == view_camera("up", 11520).width == MOST_PX


def test_a_cut_of_a_cut_is_the_direct_one():
    panorama = smooth(directions_of_pixels(WIDTH))
    wide = view_camera("right", WIDTH)
    narrow = replace(wide, width=80, height=60, fx=200.0, fy=200.0, cx=40.0, cy=30.0)
    turn = cv2.Rodrigues(np.array([0.1, 0.2, 0.3]))[0]
    narrow = replace(
        narrow, world_from_camera=np.column_stack([wide.world_from_camera[:, :3] @ turn, [0, 0, 0]])
    )
    direct = seen_in_panorama(panorama, narrow)
    sources, _ = project(wide, rays(narrow).reshape(-1, 3))
    x, y = (sources - 0.5).astype(np.float32).T.reshape(2, narrow.height, narrow.width)
    again = cv2.remap(seen_in_panorama(panorama, wide), x, y, cv2.INTER_CUBIC)
    assert np.abs(direct.astype(int) - again).max() <= 2


@pytest.mark.parametrize("columns", [1, WIDTH // 4, -37])
def test_a_panorama_shifted_is_a_camera_turned(columns):
    panorama = smooth(directions_of_pixels(WIDTH))
    angle = 2 * np.pi * columns / WIDTH
    turn = cv2.Rodrigues(np.array([0.0, angle, 0.0]))[0]
    camera = view_camera("left", WIDTH)
    pose = np.column_stack([turn @ camera.world_from_camera[:, :3], [0, 0, 0]])
    turned = seen_in_panorama(panorama, replace(camera, world_from_camera=pose))
    shifted = seen_in_panorama(np.roll(panorama, -columns, axis=1), camera)
    assert np.abs(turned.astype(int) - shifted).max() <= 1


def test_what_is_finer_than_the_view_becomes_its_mean():
    stripes = np.zeros((512, 1024, 3), np.uint8)
    stripes[:, ::2] = 255
    camera = Camera("", 40, 30, 20.0, 20.0, 20.0, 15.0, np.eye(3, 4))
    assert np.abs(seen_in_panorama(stripes, camera).astype(int) - 127).max() <= 2


def test_a_view_is_the_photograph_that_a_camera_would_take_there():
    poses, images = courtyard_panoramas(1, 640)
    for direction in ("back", "up"):
        camera = view_camera(direction, 640)
        rotation = poses[0][:, :3] @ camera.world_from_camera[:, :3]
        there = replace(camera, world_from_camera=np.column_stack([rotation, poses[0][:, 3]]))
        photograph, _ = render_view(there, CourtyardConfig(kind="walk"))
        cut = dict(cut_views(images[0]))[direction]
        error = (cut.astype(float) - photograph) / 255
        assert 10 * np.log10(1 / (error**2).mean()) > 26
