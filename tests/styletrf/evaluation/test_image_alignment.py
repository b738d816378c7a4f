"""Alignment of photographs with renders, on a textured plane that is rendered exactly."""

import cv2
import numpy as np
import pytest
import torch

from styletrf.evaluation.alignment.image_alignment import aligned, correlation, likeness
from styletrf.evaluation.alignment.photograph_placement import place_photographs
from styletrf.field.rendering import Rendering
from styletrf.geometry.cameras import Camera, fitted_to, pixel_centers, points_at_depth

DEPTH = 3.0  # of the plane z = DEPTH


def camera(center=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0), name="view") -> Camera:
    rotation = cv2.Rodrigues(np.array(spin))[0]
    pose = np.column_stack([rotation, np.array(center)])
    return Camera(name, 192, 144, 180.0, 180.0, 96.0, 72.0, pose)


def plane(seed: int):
    """Returns what renders a plane that is painted with waves; `seed` decides which."""
    rng = np.random.default_rng(seed)
    waves = rng.normal(0, 1, (40, 2)) * rng.uniform(1, 12, (40, 1))
    phases, colors = rng.uniform(0, 6.28, 40), rng.uniform(-1, 1, (40, 3))

    def render(view: Camera) -> Rendering:
        pixels, shape = pixel_centers(view.width, view.height), (view.height, view.width)
        directions = points_at_depth(view, pixels, np.ones(len(pixels))) - view.center_world
        z = (DEPTH - view.center_world[2]) / directions[:, 2]
        points = points_at_depth(view, pixels, z)[:, :2]
        values = 0.5 + np.sin(points @ waves.T + phases) @ colors / 16
        depth = torch.as_tensor(z).reshape(shape)
        color = torch.as_tensor(values.clip(0, 1).reshape(*shape, 3))
        return Rendering(color, torch.ones(shape), depth, depth)

    return render


def photograph(render, view: Camera) -> np.ndarray:
    return render(view).color.numpy()


@pytest.mark.parametrize("exposure", [(1.0, 0.0), (0.4, 0.05)])
def test_a_moved_camera_is_found_whatever_the_exposure(exposure):
    render, true = plane(0), camera((0.1, -0.05, 0.08), (0.02, -0.03, 0.01))
    gain, offset = exposure
    found = aligned(camera(), gain * photograph(render, true) + offset, render)
    apart = true.world_from_camera[:, :3].T @ found.camera.world_from_camera[:, :3]
    assert np.degrees(np.arccos(np.clip((np.trace(apart) - 1) / 2, -1, 1))) < 0.2
    assert np.linalg.norm(found.camera.center_world - true.center_world) < 0.01
    assert found.detail > 0.98


def test_an_aligned_camera_stays_where_it_is():
    render = plane(1)
    found = aligned(camera(), photograph(render, camera()), render)
    np.testing.assert_allclose(
        found.camera.world_from_camera, camera().world_from_camera, atol=1e-3
    )


def test_alignment_never_ends_at_a_worse_correlation():
    render, other = plane(0), plane(9)
    image = photograph(other, camera())
    start = fitted_to(camera(), 48)
    before = correlation(photograph(render, start), photograph(other, start))
    assert aligned(camera(), image, render, (48,)).correlation > before - 0.05


def test_a_flat_photograph_resembles_nothing():
    render = plane(0)
    found = aligned(camera(), np.full((144, 192, 3), 0.5), render)
    assert found.detail == 0.0
    assert np.isfinite(found.camera.world_from_camera).all()


def test_correlation_is_that_of_values_about_their_means():
    rng = np.random.default_rng(0)
    image = rng.random((6, 5, 3))
    assert correlation(image, 0.3 * image + 0.2) == pytest.approx(1.0)
    assert correlation(image, -image) == pytest.approx(-1.0)
    assert correlation(image, np.ones_like(image)) == 0.0


def test_a_photograph_of_the_scene_is_placed_and_one_of_another_is_not():
    render, elsewhere = plane(0), plane(5)
    known = [camera((x, 0.0, 0.0), name=f"known{x}") for x in (-0.2, 0.0, 0.2)]
    placed = [(view, photograph(render, view)) for view in known]
    true = camera((0.1, 0.06, -0.05), name="lost")
    unplaced = [(camera(name="lost"), photograph(render, true))]
    unplaced.append((camera(name="foreign"), photograph(elsewhere, true)))
    lost, foreign = place_photographs(unplaced, placed, render)
    assert lost.is_placed
    assert np.linalg.norm(lost.camera.center_world - true.center_world) < 0.01
    assert not foreign.is_placed
    assert lost.needed == foreign.needed
    assert lost.needed <= likeness(*placed[0], render, 192)


def test_nothing_is_placed_where_no_camera_is_known():
    render = plane(0)
    assert place_photographs([(camera(), photograph(render, camera()))], [], render) == []
