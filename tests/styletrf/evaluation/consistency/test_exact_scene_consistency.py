"""The measures of consistency on the embedded scene, whose depth and flow are exact."""

from dataclasses import replace

import numpy as np
import pytest

from styletrf.evaluation.consistency.frame_pairs import Frame
from styletrf.evaluation.consistency.trajectory_consistency import (
    ConsistencyConfig,
    measure_consistency,
)
from styletrf.evaluation.flow import METHODS, FlowEstimator
from styletrf.evaluation.perceptual_distance import PerceptualFeatures
from styletrf.files.float_images import FloatImage
from styletrf.geometry.cameras import pixel_centers
from styletrf.geometry.exact_flow import exact_flow
from styletrf.synthetic.courtyard import CourtyardConfig, courtyard_cameras, render_view

CONFIG = CourtyardConfig(width=120, height=90)
FRAMES = 4


@pytest.fixture(scope="module")
def views():
    """A slow pan past the fountain: cameras, float images, and the world point of each pixel."""
    start = courtyard_cameras(CONFIG)[0]
    cameras, images, points = [], [], []
    for k in range(FRAMES):
        pose = start.world_from_camera.copy()
        pose[:, 3] += 0.04 * k * pose[:, 0]
        camera = replace(start, name=f"{k}", world_from_camera=pose)
        color, depth = render_view(camera, CONFIG)
        whole = np.ones(depth.shape, np.float32)
        cameras.append(camera)
        images.append(FloatImage((color / 255).astype(np.float32), whole, depth.astype(np.float32)))
        points.append(_points(camera, depth))
    return cameras, images, points


def _points(camera, depth):
    on_plane = (pixel_centers(camera.width, camera.height) - [camera.cx, camera.cy]) / camera.fx
    rays = np.column_stack([on_plane, np.ones(len(on_plane))]) @ camera.world_from_camera[:, :3].T
    far = np.where(np.isfinite(depth), depth, 1e3).reshape(-1, 1)
    return (rays * far + camera.center_world).reshape(*depth.shape, 3)


def painted(points, frequency=1.5):
    """A stylization that is a texture of the world: perfectly consistent."""
    return (0.5 + 0.4 * np.sin(frequency * points)).astype(np.float32)


def measured(views, stylized, vgg, **options):
    cameras, images, _ = views
    frames = [Frame(*parts) for parts in zip(cameras, images, stylized, strict=True)]
    config = ConsistencyConfig(deltas=(1,), perceptual_px=32, **options)
    figures = measure_consistency(frames, FRAMES, stylized[0], PerceptualFeatures(vgg, 32), config)
    return figures.summary["delta_1"]


def test_a_consistent_stylization_scores_at_the_floor(views, vgg):
    figures = measured(views, [painted(p) for p in views[2]], vgg)
    assert figures["geometric_fraction"] > 0.7
    assert figures["geometric_error"] <= figures["geometric_floor"]
    assert figures["normalized_error"] <= figures["normalized_floor"]


def test_a_warp_that_is_a_pixel_off_is_far_from_the_floor(views, vgg):
    """So that a stylization at the floor says something of the warp, too."""
    cameras, images, points = views
    steady = measured(views, [painted(p, 8) for p in points], vgg)
    moved = [replace(camera, cx=camera.cx + k) for k, camera in enumerate(cameras)]
    off = measured((moved, images, points), [painted(p, 8) for p in points], vgg)
    assert off["geometric_error"] > 10 * steady["geometric_error"]


@pytest.mark.parametrize("method", [m for m in METHODS if m != "raft"])
def test_the_flow_of_pictures_is_near_the_exact_one(views, method):
    cameras, images, _ = views
    exact, seen = exact_flow(cameras[0], images[0].depth, cameras[-1], images[-1].depth, 0.02)
    found = FlowEstimator(method)(images[0].color, images[-1].color)
    errors_px = np.linalg.norm(found - exact, axis=-1)[seen]
    moved_px = np.linalg.norm(exact, axis=-1)[seen]
    assert np.median(errors_px) < 0.2 * np.median(moved_px)


def test_flicker_of_all_of_a_frame_is_recovered(views, vgg):
    """Each frame brighter or darker by a known amount: its mean square, above the floor."""
    change = np.random.default_rng(0).normal(0, 0.08, FRAMES).astype(np.float32)
    still = [painted(p) for p in views[2]]
    steady = measured(views, still, vgg)
    figures = measured(views, [s + c for s, c in zip(still, change, strict=True)], vgg)
    injected = float(np.mean(np.diff(change) ** 2))
    found = figures["geometric_error"] - steady["geometric_error"]
    assert found == pytest.approx(injected, rel=0.05)


def test_flicker_of_every_pixel_is_recovered(views, vgg):
    """Noise of known variance: once as it is, once as the cubic warp smooths it."""
    sigma, random = 0.02, np.random.default_rng(0)  # so small that nothing leaves [0, 1]
    still = [painted(p) for p in views[2]]
    noisy = [s + random.normal(0, sigma, s.shape).astype(np.float32) for s in still]
    kept = np.mean([_energy_kept(views, k) for k in range(FRAMES - 1)])
    steady, figures = (measured(views, frames, vgg) for frames in (still, noisy))
    found = figures["geometric_error"] - steady["geometric_error"]
    assert found == pytest.approx((1 + kept) * sigma**2, rel=0.05)


def _energy_kept(views, k):
    """The mean over what is seen of the squared weights with which 16 pixels are mixed."""
    cameras, images, _ = views
    a, b = k, k + 1
    flow, seen = exact_flow(cameras[a], images[a].depth, cameras[b], images[b].depth, 0.02)
    x, y = np.moveaxis(flow - np.floor(flow), -1, 0)
    kept = _squared_cubic_weights(x) * _squared_cubic_weights(y)
    return kept[seen].mean()


def _squared_cubic_weights(t, a=-0.75):
    """The sum of the squares of the four weights of Keys (1981), with OpenCV's parameter."""
    near, far = np.stack([t, 1 - t]), np.stack([1 + t, 2 - t])
    of_near = (a + 2) * near**3 - (a + 3) * near**2 + 1
    of_far = a * far**3 - 5 * a * far**2 + 8 * a * far - 4 * a
    return (of_near**2 + of_far**2).sum(axis=0)
