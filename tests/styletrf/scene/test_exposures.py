"""Exposures are found from what views share, and nothing is found where nothing differs."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from styletrf.geometry.cameras import Camera
from styletrf.geometry.point_table import SparsePoints
from styletrf.scene.exposure_choice import (
    ExposureEvidence,
    exposure_evidence,
    taken_by_several,
)
from styletrf.scene.exposures import LEAST_OBSERVATIONS, MIDDLE, Exposures, estimate_exposures
from styletrf.scene.observed_colors import observed_colors

VIEWS, POINTS = 9, 400


def sparse(point: np.ndarray, view: np.ndarray, n_points: int = POINTS) -> SparsePoints:
    xyz = np.random.default_rng(3).normal(size=(n_points, 3))
    return SparsePoints(
        xyz, np.zeros((n_points, 3), np.uint8), np.zeros(n_points), point, view,
        np.full((len(point), 2), 8.0),
    )  # fmt: skip


def seen_by_half_of_the_views() -> SparsePoints:
    point, view = np.nonzero(np.random.default_rng(0).random((POINTS, VIEWS)) < 0.5)
    return sparse(point, view)


def true_exposures(spread: float, *, powers: bool) -> Exposures:
    """Drawn, with the identity for their median."""
    rng = np.random.default_rng(1)
    gain, power = rng.uniform(-spread, spread, (2, VIEWS, 3))
    power = np.exp(power if powers else 0 * power)
    power /= np.median(power, axis=0)
    return Exposures(gain - power * np.median(gain / power, axis=0), power)


def seen(points: SparsePoints, exposures: Exposures, noise: float = 0.0) -> np.ndarray:
    """The log colors that the views show of points whose own are drawn."""
    rng = np.random.default_rng(2)
    own = np.log(rng.uniform(0.1, 0.9, (len(points.xyz_world), 3)))[points.observed_point]
    view = points.observed_image
    line = exposures.log_gain[view] + exposures.power[view] * (own - np.log(MIDDLE))
    return np.log(MIDDLE) + line + noise * rng.normal(size=own.shape)


def cameras(n: int = VIEWS) -> Sequence[Camera]:
    return [Camera(f"{k}", 16, 16, 16.0, 16.0, 8.0, 8.0, np.eye(4)[:3]) for k in range(n)]


def evidence(points: SparsePoints, log_color: np.ndarray) -> ExposureEvidence:
    return exposure_evidence(points, log_color, cameras())


@pytest.mark.parametrize("powers", [False, True])
def test_exposures_are_found_exactly_where_nothing_else_differs(powers):
    points, true = seen_by_half_of_the_views(), true_exposures(0.3, powers=powers)
    found = estimate_exposures(points, seen(points, true), VIEWS, powers=powers)
    np.testing.assert_allclose(found.log_gain, true.log_gain, atol=3e-3)
    np.testing.assert_allclose(found.power, true.power, atol=3e-3)


def test_noise_spoils_them_by_its_share_of_an_observation():
    points, true = seen_by_half_of_the_views(), true_exposures(0.2, powers=True)
    found = estimate_exposures(points, seen(points, true, noise=0.05), VIEWS)
    assert np.abs(found.log_gain - true.log_gain).max() < 5 * 0.05 / np.sqrt(POINTS / 2)
    assert np.abs(found.power - true.power).max() < 5 * 0.05 / 0.6 / np.sqrt(POINTS / 2)


def test_photographs_that_are_all_brighter_are_not_exposed_unlike_each_other():
    points, true = seen_by_half_of_the_views(), true_exposures(0.2, powers=False)
    log_color = seen(points, true, noise=0.05)
    found, brighter = (
        estimate_exposures(points, log_color + more, VIEWS, powers=False) for more in (0, 0.7)
    )
    np.testing.assert_allclose(found.log_gain, brighter.log_gain, atol=1e-9)


def test_one_outlying_view_does_not_shift_the_others():
    points, true = seen_by_half_of_the_views(), true_exposures(0.1, powers=True)
    log_color = seen(points, true, noise=0.02)
    found = estimate_exposures(points, log_color, VIEWS)
    rng = np.random.default_rng(4)
    of_view = points.observed_image == 4
    log_color[of_view] = np.log(rng.uniform(0.05, 0.95, (of_view.sum(), 3)))
    spoiled = estimate_exposures(points, log_color, VIEWS)
    others = np.arange(VIEWS) != 4
    np.testing.assert_allclose(spoiled.log_gain[others], found.log_gain[others], atol=0.03)
    np.testing.assert_allclose(spoiled.power[others], found.power[others], atol=0.06)


def test_highlights_on_a_tenth_of_what_is_seen_hardly_count():
    points, true = seen_by_half_of_the_views(), true_exposures(0.2, powers=True)
    log_color = seen(points, true, noise=0.02)
    shiny = np.random.default_rng(5).random(len(log_color)) < 0.1
    log_color[shiny] += 0.8
    found = estimate_exposures(points, log_color, VIEWS)
    np.testing.assert_allclose(found.log_gain, true.log_gain, atol=0.03)


def test_what_is_saturated_does_not_count():
    points, true = seen_by_half_of_the_views(), true_exposures(0.3, powers=False)
    shown = np.exp(seen(points, true))
    log_color = np.where(shown < 0.95, np.log(shown), np.nan)
    found = estimate_exposures(points, log_color, VIEWS, powers=False)
    np.testing.assert_allclose(found.log_gain, true.log_gain, atol=3e-3)


def test_a_drift_is_found_along_a_walk_whose_ends_share_nothing():
    n = 60
    view = np.repeat(np.arange(n), 60)
    point = np.concatenate([20 * k + np.arange(60) for k in range(n)])
    points = sparse(point, view, 20 * n + 60)
    drift = np.linspace(-0.4, 0.4, n)
    own = np.log(np.random.default_rng(6).uniform(0.1, 0.6, 20 * n + 60))
    log_color = (own[point] + drift[view])[:, None]
    found = estimate_exposures(points, log_color, n, powers=False)
    np.testing.assert_allclose(found.log_gain[:, 0], drift, atol=0.01)


def test_evened_colors_are_those_of_the_scene():
    points, true = seen_by_half_of_the_views(), true_exposures(0.3, powers=True)
    identity = Exposures(np.zeros((VIEWS, 3)), np.ones((VIEWS, 3)))
    evened = true.evened(np.exp(seen(points, true)), points.observed_image)
    np.testing.assert_allclose(evened, np.exp(seen(points, identity)), rtol=1e-9)


def test_noise_alone_keeps_the_identity():
    points = seen_by_half_of_the_views()
    found = evidence(points, seen(points, true_exposures(0.0, powers=False), noise=0.1))
    assert not found.needed, found


@pytest.mark.parametrize(("spread", "powers"), [(0.2, False), (0.2, True)])
def test_exposures_beyond_the_noise_are_needed(spread, powers):
    points, true = seen_by_half_of_the_views(), true_exposures(spread, powers=powers)
    found = evidence(points, seen(points, true, noise=0.1))
    assert found.needed, found
    gains = np.array([found.exposures[f"{k}"].log_gain for k in range(VIEWS)])
    np.testing.assert_allclose(gains, true.log_gain, atol=0.05)


def test_light_from_a_side_that_changes_from_view_to_view_is_no_exposure():
    points = seen_by_half_of_the_views()
    log_color = seen(points, true_exposures(0.0, powers=False), noise=0.02)
    is_left = points.xyz_world[points.observed_point, :1] < 0
    shading = np.random.default_rng(7).uniform(-0.3, 0.3, VIEWS)[points.observed_image, None]
    found = evidence(points, log_color + np.where(is_left, shading, -shading))
    assert not found.needed, found


def evidence_around_a_table(
    exposures: Exposures, *, noise: float, sheen: float
) -> ExposureEvidence:
    """Half of what the views see is a table, whose log colors change from view to view."""
    points = seen_by_half_of_the_views()
    points = replace(points, xyz_world=points.xyz_world * [4, 2, 1])
    is_table = points.xyz_world[points.observed_point, :1] < 0
    of_view = np.random.default_rng(7).uniform(-sheen, sheen, VIEWS)
    of_table = np.where(is_table, of_view[points.observed_image, None], 0.0)
    return evidence(points, seen(points, exposures, noise) + of_table)


def test_the_sheen_of_a_table_is_no_exposure_of_what_stands_on_it():
    """It changes from view to view, in both halves of a chessboard alike."""
    found = evidence_around_a_table(true_exposures(0.0, powers=False), noise=0.02, sheen=0.3)
    assert not found.needed, found


def test_exposures_beside_a_sheen_of_their_own_size_are_found():
    """As those of photographs all around a table by a window."""
    found = evidence_around_a_table(true_exposures(0.2, powers=True), noise=0.05, sheen=0.2)
    assert found.needed, found
    assert found.spread < 2 * found.disagreement, "the ratio that was asked for before"


def test_photographs_of_several_cameras_need_less_agreement():
    points = seen_by_half_of_the_views()
    log_color = seen(points, true_exposures(0.2, powers=True), noise=0.05)
    several = exposure_evidence(points, log_color, cameras(), several_cameras=True)
    assert several.least_ratio < evidence(points, log_color).least_ratio
    found = ExposureEvidence(0.1, 0.09, {})
    assert replace(found, several_cameras=True).needed > found.needed


@pytest.mark.parametrize(
    ("long_sides_px", "are_several"),
    [([4032, 6000, 2592], True), ([4032, 4032], False), ([4032, 3900], False), ([], False)],
)
def test_photographs_of_clearly_different_sizes_are_of_several_cameras(long_sides_px, are_several):
    assert taken_by_several(long_sides_px) == are_several


@pytest.mark.parametrize("n", [0, 1, LEAST_OBSERVATIONS - 1])
def test_views_that_share_too_little_keep_the_identity(n):
    point = np.repeat(np.arange(n), 2)
    points = sparse(point, np.tile([0, 1], n), max(n, 1))
    log_color = np.log(np.tile([[0.2] * 3, [0.6] * 3], (n, 1)))
    found = exposure_evidence(points, log_color, cameras(2))
    assert not found.needed
    assert {e.log_gain for e in found.exposures.values()} == {(0.0, 0.0, 0.0)}
    assert {e.power for e in found.exposures.values()} == {(1.0, 1.0, 1.0)}


@pytest.mark.parametrize("brightness", [0.0, 1.0])
def test_black_and_white_images_tell_nothing(brightness):
    points = seen_by_half_of_the_views()
    images = [np.full((16, 16, 3), brightness, np.float32)] * VIEWS
    found = evidence(points, observed_colors(images, points).log_color)
    assert found.spread == found.disagreement == 0
    assert not found.needed


def along_a_walk(n: int) -> SparsePoints:
    """Each view shares points with those a few steps before and after."""
    view = np.repeat(np.arange(n), 120)
    point = np.concatenate([20 * k + np.arange(120) for k in range(n)])
    return sparse(point, view, 20 * n + 120)


@pytest.mark.parametrize(("slowly", "needed"), [(True, False), (False, True)])
def test_what_changes_slowly_along_the_way_is_left_to_the_field(slowly, needed):
    n = 40
    points = along_a_walk(n)
    change = 0.2 * np.sin(2 * np.pi * np.arange(n) / n)
    change = change if slowly else np.random.default_rng(8).permutation(change)
    own = np.log(np.random.default_rng(9).uniform(0.1, 0.6, (len(points.xyz_world), 3)))
    log_color = own[points.observed_point] + change[points.observed_image, None]
    found = exposure_evidence(points, log_color, cameras(n))
    assert found.needed == needed, found
