"""Turned directions are counted from their mean, in units of how much they differ."""

from dataclasses import replace

import numpy as np
import pytest

from styletrf.viewer.view_directions import view_directions
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
