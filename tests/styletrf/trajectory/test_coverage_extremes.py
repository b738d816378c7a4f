"""Coverage at any distance: a view shows what lies behind its own pixels."""

import numpy as np
import pytest

from styletrf.geometry.cameras import Camera, project
from styletrf.trajectory.coverage import CoverageConfig, places_seen, shown

COVERAGE = pytest.mark.extremes("Coverage")
CAMERA = Camera("c", 32, 24, 32.0, 32.0, 16.0, 12.0, np.column_stack([np.eye(3), np.zeros(3)]))


@COVERAGE
@pytest.mark.parametrize("depth", [1e-9, 1.0, 1e9, 1e30])
def test_a_view_shows_the_places_behind_its_pixels_at_any_depth(depth, stability):
    depths = np.full((24, 32), depth, np.float32)
    places = places_seen([CAMERA], [depths])
    found = shown(CAMERA, depths, places, CoverageConfig().tolerance)
    stability(f"share shown at {depth:g}", found.mean(), 1.0, within=0.0)
    pixels = project(CAMERA, places)[0]
    x, y = np.meshgrid(np.arange(32) + 0.5, np.arange(24) + 0.5)
    exact = np.column_stack([x.ravel(), y.ravel()])
    stability(f"their pixels at {depth:g}", pixels, exact)


@COVERAGE
def test_a_view_of_the_sky_shows_no_place():
    depths = np.full((24, 32), np.inf, np.float32)
    assert len(places_seen([CAMERA], [depths])) == 0
    assert not shown(CAMERA, depths, np.array([[0.0, 0.0, 5.0]]), 0.1).any()
