"""Splats: their covariances, their pictures, and what is solved of them."""

from dataclasses import replace

import numpy as np
import pytest

from styletrf.exports.export_views import SurfacePoints
from styletrf.exports.splat_compositing import opacity_slopes, weights_of
from styletrf.exports.splat_fit import FitConfig, SeenSplats, fitted_colors, fitted_opacities, shown
from styletrf.exports.splat_footprints import BLUR_PX2, footprints
from styletrf.exports.splat_placement import placed_splats, voxels_of
from styletrf.exports.splats import Splats, moved_splats, splats_of
from styletrf.geometry.cameras import Camera
from styletrf.geometry.rotations import matrices_of

BLACK = np.zeros(3, np.float32)


def camera(size: int = 33) -> Camera:
    pose = np.hstack([np.eye(3), np.zeros((3, 1))])
    return Camera("front", size, size, 40.0, 40.0, size / 2, size / 2, pose)


def cloud(count: int, seed: int = 0) -> Splats:
    rng = np.random.default_rng(seed)
    centers = np.column_stack([rng.uniform(-1, 1, (count, 2)), rng.uniform(3, 5, count)])
    half = rng.normal(size=(count, 3, 3)) * 0.05
    opacities = rng.uniform(0.3, 0.9, count)
    return replace(
        splats_of(centers, half @ half.transpose(0, 2, 1) + 1e-3 * np.eye(3)), opacities=opacities
    )


def single(depth: float, sigma: float, opacity: float) -> Splats:
    splats = splats_of(np.array([[0.0, 0.0, depth]]), sigma**2 * np.eye(3)[None])
    return replace(splats, opacities=np.array([opacity]))


def test_splats_have_the_covariances_they_are_made_of():
    rng = np.random.default_rng(0)
    half = rng.normal(size=(50, 3, 3))
    covariances = half @ half.transpose(0, 2, 1) + 0.1 * np.eye(3)
    assert np.allclose(splats_of(np.zeros((50, 3)), covariances).covariances(), covariances)


def test_a_similarity_moves_covariances_as_it_moves_points():
    matrix, splats = np.eye(4), cloud(20)
    matrix[:3, :3] = 2.5 * matrices_of(np.array([[0.9, 0.1, -0.3, 0.2]]))[0]
    matrix[:3, 3] = (1, 2, 3)
    linear, placed = matrix[:3, :3], moved_splats(splats, matrix)
    assert np.allclose(placed.covariances(), linear @ splats.covariances() @ linear.T)
    assert np.allclose(placed.centers, splats.centers @ linear.T + matrix[:3, 3])


def test_the_picture_of_one_splat_is_a_gaussian_over_the_background():
    view, color = camera(), np.array([[0.2, 0.5, 0.8]], np.float32)
    splats, behind = single(4.0, 0.2, 0.6), np.array([0.1, 0.1, 0.1], np.float32)
    found = shown(footprints(splats, view, 1e-4), np.float32([0.6]), color, behind)
    variance = (40 * 0.2 / 4) ** 2 + BLUR_PX2
    y, x = np.mgrid[:33, :33] - 16.0
    alpha = 0.6 * np.exp(-(x * x + y * y) / (2 * variance))[..., None]
    expected = alpha * color[0] + (1 - alpha) * behind
    assert np.abs(found.reshape(33, 33, 3) - expected).max() < 0.005  # what is cut off


def test_a_picture_composites_from_near_to_far_whatever_the_order_of_splats():
    parts = [single(3.0, 0.5, 0.5), single(4.0, 0.5, 0.5)]
    colors = np.eye(3, dtype=np.float32)[:2]
    pictures = []
    for order in ([0, 1], [1, 0]):
        both = Splats(*(np.concatenate([getattr(parts[k], n) for k in order])
                        for n in Splats.__slots__))  # fmt: skip
        view = footprints(both, camera(), 1e-4)
        pictures.append(shown(view, np.float32([0.5, 0.5]), colors[order], BLACK))
    assert np.allclose(*pictures)
    assert np.allclose(pictures[0].reshape(33, 33, 3)[16, 16], [0.5, 0.25, 0], atol=1e-3)


def test_splats_behind_the_camera_are_not_seen():
    splats = single(-4.0, 0.2, 0.9)
    assert len(footprints(splats, camera(), 1e-4).pixel) == 0


def test_weights_and_what_is_left_are_all_of_the_light():
    splats = cloud(200)
    view = footprints(splats, camera(), 1e-6)
    opacities = splats.opacities.astype(np.float32)
    weights, left = weights_of(view.n_pixels, view.pixel, view.splat, view.share, opacities)
    assert np.allclose(np.bincount(view.pixel, weights, view.n_pixels) + left, 1, atol=1e-5)


def test_slopes_of_opacities_are_those_of_finite_differences():
    splats, rng = cloud(40), np.random.default_rng(1)
    view, colors = footprints(splats, camera(), 0.0), rng.uniform(size=(40, 3)).astype(np.float32)
    wanted = rng.uniform(size=(view.n_pixels, 3)).astype(np.float32)
    opacities = splats.opacities.astype(np.float32)

    def error(values: np.ndarray) -> float:
        return float(np.square(wanted - shown(view, values, colors, BLACK).astype(float)).sum())

    now = shown(view, opacities, colors, BLACK)
    lift, total, row = np.zeros(40, np.float32), np.zeros(40, np.float32), np.zeros_like(now)
    opacity_slopes(
        view.pixel, view.splat, view.share, opacities, colors, now, wanted - now, lift, total, row
    )
    for k in range(0, 40, 7):
        step = np.zeros(40, np.float32)
        step[k] = 0.01
        slope = (error(opacities + step) - error(opacities - step)) / 0.02
        assert slope == pytest.approx(-2 * lift[k], rel=0.02, abs=0.02)


def test_colors_of_pictures_of_splats_are_found_again():
    splats, rng = cloud(60), np.random.default_rng(2)
    opacities = splats.opacities.astype(np.float32)
    colors = rng.uniform(0.1, 0.9, (60, 3)).astype(np.float32)
    view = footprints(splats, camera(), 1e-4)
    picture = shown(view, opacities, colors, BLACK)
    seen = SeenSplats([view], 60, BLACK)
    config = FitConfig(color_steps=60, prior=1e-5)
    found = fitted_colors(seen, [picture], opacities, config)
    again = shown(view, opacities, found, BLACK)
    assert np.sqrt(np.square(again - picture).mean()) < 1e-3


def test_opacity_steps_bring_pictures_closer():
    splats, rng = cloud(60), np.random.default_rng(3)
    colors = rng.uniform(0, 1, (60, 3)).astype(np.float32)
    view = footprints(splats, camera(), 1e-4)
    picture = shown(view, splats.opacities.astype(np.float32), colors, BLACK)
    seen = SeenSplats([view], 60, BLACK)

    def error(rounds: int) -> float:
        config = FitConfig(opacity=0.9, rounds=rounds)
        opacities = fitted_opacities(seen, [picture], config)
        fitted = fitted_colors(seen, [picture], opacities, config)
        return float(np.square(shown(view, opacities, fitted, BLACK) - picture).mean())

    assert error(6) < 0.5 * error(0)


@pytest.mark.parametrize("most", [1, 10, 500])
def test_there_are_never_more_voxels_than_allowed(most: int):
    points = np.random.default_rng(4).uniform(-1, 1, (3000, 3))
    assert 0 < len(np.unique(voxels_of(points, (64, 64, 64), most))) <= most


def test_splats_of_a_plane_are_flat_along_it():
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform(-1, 1, (20000, 2)), np.zeros(20000)])
    placed = placed_splats(
        SurfacePoints(points, np.full(len(points), 0.02)), points, (64, 64, 64), 400
    )
    thin = matrices_of(placed.rotations)[:, :, 0]  # the axis of the least deviation
    assert len(placed) <= 400
    assert np.median(np.abs(thin[:, 2])) > 0.99
    assert np.allclose(placed.centers[:, 2], 0)
