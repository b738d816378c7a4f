import numpy as np
import pycolmap
import pytest
from expected_errors import rejects

from styletrf.geometry.cameras import project
from styletrf.geometry.undistortion import pinhole_for, undistorted_image, undistorted_pixels

POSE = np.eye(3, 4)


def lens(k, width=64, height=48):
    params = [50.0, width / 2 + 0.7, height / 2 - 0.4, k]
    return pycolmap.Camera(model="SIMPLE_RADIAL", width=width, height=height, params=params)


def seen_through(some_lens, scene):
    """Returns the photograph of a scene at infinity, colors as a function of ray slopes."""
    y, x = np.mgrid[0 : some_lens.height, 0 : some_lens.width] + 0.5
    slopes = some_lens.cam_from_img(np.stack([x, y], axis=-1).reshape(-1, 2))
    return np.rint(scene(slopes)).astype(np.uint8).reshape(some_lens.height, some_lens.width, 3)


def test_a_lens_without_distortion_is_left_alone():
    image = np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8)
    camera = pinhole_for(lens(0.0), "a", POSE)
    assert (camera.fx, camera.fy) == pytest.approx((50.0, 50.0))
    assert np.array_equal(undistorted_image(image, lens(0.0), camera), image)


@pytest.mark.parametrize("k", [-0.12, -0.02, 0.02, 0.12])
def test_every_pixel_comes_from_within_the_photograph(k):
    """And one of them from its very edge: the zoom is no larger than needed."""
    camera = pinhole_for(lens(k), "a", POSE)
    assert (camera.width, camera.height) == (64, 48)
    x, y = np.meshgrid(np.linspace(0, 64, 129), np.linspace(0, 48, 97))
    corners = np.stack([x, y], axis=-1).reshape(-1, 2)
    slopes = (corners - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    sources = lens(k).img_from_cam(np.column_stack([slopes, np.ones(len(slopes))]))
    margin = np.minimum(sources, [64, 48] - sources).min()
    assert abs(margin) < 0.01


@pytest.mark.parametrize("k", [-0.12, 0.12])
def test_the_image_is_what_the_pinhole_camera_sees(k):
    def scene(slopes):
        wave = np.sin(6 * slopes[:, :1] + 4 * slopes[:, 1:])
        return 127 + 90 * np.concatenate([wave, -wave, wave**2], axis=-1)

    camera = pinhole_for(lens(k), "a", POSE)
    straight = pycolmap.Camera(
        model="PINHOLE", width=64, height=48, params=[camera.fx, camera.fy, camera.cx, camera.cy]
    )
    found = undistorted_image(seen_through(lens(k), scene), lens(k), camera).astype(int)
    expected = seen_through(straight, scene).astype(int)
    assert np.abs(found - expected).max() <= 4  # at the border; rounding twice
    assert np.abs(found - expected).mean() < 0.5


def test_pixels_go_where_the_pinhole_camera_projects():
    points = np.random.default_rng(0).uniform([-0.5, -0.4, 1], [0.5, 0.4, 1.2], (100, 3))
    camera = pinhole_for(lens(0.08), "a", POSE)
    distorted = lens(0.08).img_from_cam(points)
    expected, _ = project(camera, points)
    assert np.allclose(undistorted_pixels(distorted, lens(0.08), camera), expected, atol=1e-6)


@pytest.mark.parametrize("x", [-5.0, 69.0])
def test_a_lens_that_bends_lines_and_whose_axis_misses_the_photograph_is_refused(x):
    """The search for a zoom did not end."""
    bent = pycolmap.Camera(model="SIMPLE_RADIAL", width=64, height=48, params=[50, x, 24, -0.1])
    with rejects("photograph a", x):
        pinhole_for(bent, "a", POSE)


@pytest.mark.parametrize("wrong", [0.0, -50.0, np.inf, np.nan])
def test_a_lens_without_a_positive_focal_length_is_refused(wrong):
    for params in ([wrong, 50, 32, 24], [50, wrong, 32, 24]):
        bent = pycolmap.Camera(model="PINHOLE", width=64, height=48, params=params)
        with rejects("photograph a", "PINHOLE"):
            pinhole_for(bent, "a", POSE)


@pytest.mark.parametrize(("width", "height"), [(0, 0), (0, 48), (64, 0)])
def test_a_lens_of_no_size_is_refused(width, height):
    """The search for a zoom did not end."""
    with rejects("photograph a", f"{width}x{height}"):
        pinhole_for(lens(0.0, width, height), "a", POSE)


def test_a_lens_of_a_panorama_is_refused():
    panorama = pycolmap.Camera(model="EQUIRECTANGULAR", width=64, height=32, params=[])
    with rejects("photograph a", "EQUIRECTANGULAR"):
        pinhole_for(panorama, "a", POSE)


def test_a_pinhole_camera_stays_as_it_is_also_where_its_axis_misses_the_photograph():
    cropped = pycolmap.Camera(model="PINHOLE", width=64, height=48, params=[50, 50, -5, 24])
    camera = pinhole_for(cropped, "a", POSE)
    assert (camera.fx, camera.cx) == pytest.approx((50, -5))


def wide_lens(model, focal, k):
    shared = [focal * 640, 320, 240] if model == "SIMPLE_RADIAL" else [focal * 640] * 2 + [320, 240]
    params = [*shared, k] if model == "SIMPLE_RADIAL" else [*shared, k, 0, 0, 0]
    return pycolmap.Camera(model=model, width=640, height=480, params=params)


@pytest.mark.parametrize("model", ["SIMPLE_RADIAL", "OPENCV", "OPENCV_FISHEYE"])
@pytest.mark.parametrize(("focal", "k"), [(0.25, -0.1), (0.5, -0.1), (0.6, -0.25), (0.8, -0.35)])
def test_a_wide_lens_whose_model_folds_back_fills_an_image_once(model, focal, k):
    """A solve failed: the corners of such a photograph have no direction, and the zoom was NaN."""
    lens = wide_lens(model, focal, k)
    camera = pinhole_for(lens, "a", POSE)
    x, y = np.meshgrid(np.linspace(0, 640, 65), np.linspace(0, 480, 49))
    slopes = (np.stack([x, y], -1).reshape(-1, 2) - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    pixels = lens.img_from_cam(np.column_stack([slopes, np.ones(len(slopes))]))
    assert (pixels > -0.05).all()
    assert (pixels < [640.05, 480.05]).all()
    assert np.allclose(lens.cam_from_img(pixels), slopes, rtol=1e-3, atol=1e-5)
    assert 640 / camera.fx <= 4.01
