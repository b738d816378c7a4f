"""Turned directions are counted from their mean, in units of how much they differ."""

from dataclasses import replace

import numpy as np
import pytest

from styletrf.viewer.view_directions import MONOMIALS, ViewDirections, view_directions
from styletrf.viewer.viewer_content import RENDER
from styletrf.viewer.visibility import Views, heavy_samples


@pytest.mark.parametrize("space", ["ndc", "box", "unbounded"])
def test_directions_of_all_rays_differ_by_one_along_each_axis(tiny, space):
    scene = tiny(space)
    field, views = scene.fields["Photographs"], Views(scene.model.space, scene.cameras, RENDER)
    directions = view_directions(views, field.step_length)
    turned = np.concatenate(
        [
            directions.turned(heavy_samples(field, views, camera)[1].numpy())
            for camera in scene.cameras
        ]
    )
    np.testing.assert_allclose(turned.mean(axis=0), 0, atol=0.02)
    np.testing.assert_allclose(np.cov(turned.T), np.eye(3), atol=0.05)


def test_directions_that_are_all_the_same_turn_to_nothing_large(tiny):
    scene = tiny("box")
    narrow = [replace(scene.cameras[0], fx=1e6, fy=1e6)]
    views = Views(scene.model.space, narrow, RENDER)
    directions = view_directions(views, scene.fields["Photographs"].step_length)
    assert np.isfinite(directions.axes).all()
    assert np.abs(directions.turned(narrow[0].forward_world[None])).max() < 0.1


@pytest.fixture
def tinted() -> ViewDirections:
    tint = np.random.default_rng(0).normal(size=(len(MONOMIALS), 3))
    extent = np.array([2.0, 1.5, 1.0], np.float32)
    parts = np.zeros(3), np.eye(3), -extent, extent, tint
    return ViewDirections(*(part.astype(np.float32) for part in parts))


@pytest.mark.parametrize("n", range(len(MONOMIALS)))
def test_a_tint_is_the_sum_of_products_of_what_directions_are_turned_to(tinted, n):
    turned = np.random.default_rng(1).uniform(-1, 1, (9, 3)).astype(np.float32)
    only = np.zeros_like(tinted.tint)
    only[n] = tinted.tint[n]
    product = turned[:, list(MONOMIALS[n])].prod(axis=1)
    expected = product[:, None] * tinted.tint[n]
    np.testing.assert_allclose(replace(tinted, tint=only).tints(turned), expected, atol=1e-6)


def test_beyond_the_views_the_tint_is_that_of_the_nearest_direction(tinted):
    far = np.random.default_rng(2).uniform(-9, 9, (50, 3)).astype(np.float32)
    nearest = far.clip(tinted.least, tinted.most)
    np.testing.assert_array_equal(tinted.tints(far), tinted.tints(nearest))


def test_views_begin_without_a_tint_and_know_how_far_they_turn(tiny):
    scene = tiny("box")
    views = Views(scene.model.space, scene.cameras, RENDER)
    directions = view_directions(views, scene.fields["Photographs"].step_length)
    ahead = np.stack([camera.forward_world for camera in scene.cameras])
    turned = directions.turned(ahead / np.linalg.norm(ahead, axis=1, keepdims=True))
    assert (directions.least < turned).all()
    assert (turned < directions.most).all()
    np.testing.assert_array_equal(directions.tints(turned), 0)
