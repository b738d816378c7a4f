"""The courtyard in three captures: each gets the model it needs, from exact points and colors."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from styletrf.files.images import from_integers, to_integers
from styletrf.geometry.cameras import pixel_centers, project
from styletrf.geometry.point_table import SparsePoints
from styletrf.scene.exposure_choice import exposure_evidence
from styletrf.scene.observed_colors import observed_colors
from styletrf.scene.scene_model import SceneModelConfig, decide_scene_model
from styletrf.scene.view_dependence import view_dependence
from styletrf.synthetic.courtyard import capture as capturing
from styletrf.synthetic.courtyard.capture import Capture, CourtyardConfig, capture_courtyard
from styletrf.synthetic.courtyard.shading import Surfaces

CONFIG = CourtyardConfig(n_views=32, width=200, height=150)


@cache
def captured(kind: str, *, glossy: bool) -> Capture:
    """Without gloss the vase stays, and so does the light."""
    with pytest.MonkeyPatch.context() as patch:
        if not glossy:
            scene = matte(capturing.lit_scene(replace(CONFIG, kind=kind)))
            patch.setattr(capturing, "lit_scene", lambda _config: scene)
        return capture_courtyard(replace(CONFIG, kind=kind))


def matte(scene: Surfaces) -> Surfaces:
    """The scene without its mirror images."""
    textures = scene.textures.copy()
    textures[:, 3] = 0
    return scene._replace(textures=textures)


def even(depth: np.ndarray) -> np.ndarray:
    """Where no edge of depth is near, as where features are found that last."""
    near, far = (how(depth, np.ones((7, 7))) for how in (cv2.erode, cv2.dilate))
    return np.isfinite(far) & (far < 1.1 * np.minimum(near, 1e6))


def surface_points(capture: Capture, each: int = 250) -> np.ndarray:
    """Points on what the views show, as many of each."""
    rng, found = np.random.default_rng(0), []
    for camera, depth in zip(capture.cameras, capture.depths, strict=True):
        chosen = rng.permutation(np.flatnonzero(even(depth)))[:each]
        x, y = pixel_centers(camera.width, camera.height)[chosen].T
        z = depth.reshape(-1)[chosen]
        in_camera = np.stack([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 0 * x + 1])
        found.append((camera.world_from_camera[:, :3] @ (z * in_camera)).T + camera.center_world)
    return np.concatenate(found)


@cache
def tracks(kind: str, *, glossy: bool) -> SparsePoints:
    """Where the views see the points, as their depth tells."""
    capture = captured(kind, glossy=glossy)
    points, rows = surface_points(capture, 150), []
    for k, (camera, depth) in enumerate(zip(capture.cameras, capture.depths, strict=True)):
        pixels, z = project(camera, points)
        inside = (z > 0) & (pixels > 0).all(1) & (pixels < [camera.width, camera.height]).all(1)
        column, row = np.floor(pixels[inside]).astype(int).T
        fits = np.abs(depth[row, column] / z[inside] - 1) < 0.01
        seen = np.flatnonzero(inside)[fits & even(depth)[row, column]]
        rows += [(p, k, *pixels[p]) for p in seen]
    table = np.array(sorted(rows))
    of, n = table[:, :2].astype(np.int64), len(points)
    return SparsePoints(
        points, np.zeros((n, 3), np.uint8), np.zeros(n), of[:, 0], of[:, 1], table[:, 2:]
    )


@pytest.mark.parametrize(
    ("kind", "space", "looking"),
    [("forward", "ndc", "ahead"), ("orbit", "unbounded", "inward"), ("walk", "unbounded", "along")],
)
def test_each_capture_gets_its_space_and_its_path(kind, space, looking):
    capture = captured(kind, glossy=True)
    points = surface_points(capture)
    model = decide_scene_model(capture.cameras, points, SceneModelConfig(max_voxels=224**3))
    assert (model.space.kind, model.looking) == (space, looking), model.evidence


@pytest.mark.parametrize("glossy", [True, False])
def test_the_glossy_vase_needs_colors_that_depend_on_the_view_and_all_else_does_not(glossy):
    capture = captured("orbit", glossy=glossy)
    images = [from_integers(image) for image in capture.images]
    points = tracks("orbit", glossy=glossy)
    found = view_dependence(observed_colors(images, points), points, capture.cameras)
    assert found.needed == glossy, found


@pytest.mark.parametrize(("kind", "glossy"), [("forward", True), ("orbit", True), ("walk", True)])
def test_photographs_of_one_exposure_keep_it_whatever_shines(kind, glossy):
    capture, points = captured(kind, glossy=glossy), tracks(kind, glossy=glossy)
    observed = observed_colors(map(from_integers, capture.images), points)
    found = exposure_evidence(points, observed.log_color, capture.cameras)
    assert not found.needed, found


def test_changing_exposures_are_found_and_shiny_surfaces_stay_shiny():
    capture = captured("orbit", glossy=True)
    points, rng = tracks("orbit", glossy=True), np.random.default_rng(0)
    log_gain = rng.uniform(-0.2, 0.2, (CONFIG.n_views, 1)) + rng.uniform(
        -0.2, 0.2, (CONFIG.n_views, 3)
    )
    log_gain -= np.median(log_gain, axis=0)
    images = [
        from_integers(to_integers((np.exp(gain) * from_integers(image)).clip(0, 1)))
        for gain, image in zip(log_gain, capture.images, strict=True)
    ]
    observed = observed_colors(images, points)
    found = exposure_evidence(points, observed.log_color, capture.cameras)
    assert found.needed, found
    gains = np.array([found.exposures[camera.name].log_gain for camera in capture.cameras])
    np.testing.assert_allclose(gains, log_gain, atol=0.04)
    assert view_dependence(observed, points, capture.cameras).needed
