"""Alignment of photographs with renders, on a textured plane that is rendered exactly."""

import numpy as np
import pytest
from alignment_cases import camera, photograph, plane

from styletrf.evaluation.alignment.image_alignment import aligned, correlation, likeness
from styletrf.evaluation.alignment.photograph_placement import place_photographs
from styletrf.geometry.cameras import fitted_to, resized


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


def test_pixels_that_all_count_are_compared_whatever_the_size_of_the_photograph():
    render, asked = plane(0), []
    large = resized(camera(), 6000, 900)
    image = np.full((900, 6000, 3), 0.5, np.float32)

    def watched(view):
        asked.append(view)
        return render(view)

    aligned(large, image, watched, [96], np.ones((900, 6000), dtype=bool))
    assert asked


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
