"""A curve goes through its key frames, evenly, and returns where it is closed."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from quaternions import about, any_quaternions

from styletrf.geometry.rotations import angles_between, matrices_of
from styletrf.trajectory.camera_curve import (
    TURN,
    ZOOM,
    CameraCurve,
    Poses,
    curve_through,
    eased,
    ways_between,
)

FRACTIONS = np.linspace(0, 1, 301)


def any_poses(n: int, seed: int = 0) -> Poses:
    rng = np.random.default_rng(seed)
    return Poses(rng.normal(size=(n, 3)), any_quaternions(n, seed), rng.uniform(0.5, 2, n))


def still(centers: np.ndarray) -> Poses:
    """Poses at centers that all look one way."""
    n = len(centers)
    return Poses(np.asarray(centers, float), np.repeat(about(1, 0.3), n, axis=0), np.full(n, 0.8))


def assert_same(found: Poses, exact: Poses) -> None:
    np.testing.assert_allclose(found.centers, exact.centers, atol=1e-12)
    np.testing.assert_allclose(found.focals, exact.focals, rtol=1e-12)
    assert angles_between(found.quaternions, exact.quaternions).max() < 1e-7


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("n", [1, 2, 3, 4, 20])
def test_key_frames_are_passed_through_exactly(n, closed):
    keys = any_poses(n)
    curve = curve_through(keys, closed=closed)
    assert_same(curve.at(curve.key_knots[:n]), keys)


def test_key_frames_with_times_are_there_at_their_times():
    keys, times = any_poses(5), np.array([0.5, 1.0, 1.25, 7.0, 8.0])
    assert_same(curve_through(keys).at_times(times, times), keys)


def test_times_change_the_speed_alone_and_a_camera_that_is_held_stays():
    """Times were knots: the camera drifted during a hold, and ran ahead of an early key frame."""
    held, moving = [0, 1, 1, 2, 3, 4], any_poses(5)
    keys = Poses(*(of_all[held] for of_all in (moving.centers, moving.quaternions, moving.focals)))
    times = np.array([0.0, 0.5, 8.0, 8.2, 12.0, 12.5])
    during = curve_through(keys).at_times(np.linspace(0.5, 8.0, 50), times)
    one = any_repeat(Poses(keys.centers[1:2], keys.quaternions[1:2], keys.focals[1:2]), 50)
    np.testing.assert_allclose(during.centers, one.centers, atol=1e-5)
    assert angles_between(during.quaternions, one.quaternions).max() < 1e-5
    np.testing.assert_allclose(during.focals, one.focals, rtol=1e-12)


@settings(deadline=None, max_examples=25)
@given(st.lists(st.floats(0.01, 10), min_size=3, max_size=6))
def test_on_a_line_a_camera_with_times_never_goes_back(steps):
    line = still(np.arange(len(steps) + 1.0)[:, None] * np.eye(3)[0])
    times = np.concatenate([[0.0], np.cumsum(steps)])
    found = curve_through(line).at_times(np.linspace(0, times[-1], 301), times)
    assert (np.diff(found.centers[:, 0]) > -1e-9).all()


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("gap", [0.0, 0.01, 1.0])
def test_a_focal_length_stays_between_those_of_the_key_frames_beside_it(closed, gap):
    """A zoom without movement made it explode."""
    keys = still(np.array([0.0, 1.0, 1.0 + gap, 2.0 + gap])[:, None] * np.eye(3)[2])
    keys = Poses(keys.centers, keys.quaternions, np.array([0.9, 0.9, 1.4, 1.2]))
    curve = curve_through(keys, closed=closed)
    ends = curve.at(curve.key_knots).focals
    for k, (start, end) in enumerate(pairwise(curve.key_knots)):
        focals = curve.at(np.linspace(start, end, 100)).focals
        assert focals.min() >= ends[k : k + 2].min() * (1 - 1e-12)
        assert focals.max() <= ends[k : k + 2].max() * (1 + 1e-12)


@pytest.mark.parametrize("closed", [False, True])
def test_orientations_stay_rotations(closed):
    found = curve_through(any_poses(12), closed=closed).at_fractions(FRACTIONS)
    rotations = matrices_of(found.quaternions)
    np.testing.assert_allclose(
        np.einsum("nji,njk->nik", rotations, rotations), np.eye(3)[None].repeat(301, 0), atol=1e-12
    )
    assert np.linalg.det(rotations) == pytest.approx(1)


def test_a_camera_curve_has_a_constant_speed():
    curve = curve_through(still(np.random.default_rng(0).normal(size=(8, 3))))
    steps = np.linalg.norm(
        np.diff(curve.at_fractions(np.linspace(0, 1, 5000)).centers, axis=0), axis=1
    )
    assert steps.max() / steps.min() < 1.02


def test_a_turn_on_the_spot_takes_its_time():
    """And no more than that: a camera that turns slowly while it moves is not held up."""
    quaternions = np.concatenate([about(1, angle) for angle in (0.0, 1.0, 2.0)])
    keys = Poses(np.zeros((3, 3)), quaternions, np.ones(3))
    ways = ways_between(curve_through(keys).at_fractions(np.linspace(0, 1, 100)))
    assert ways.max() == pytest.approx(TURN * 2.0 / 99, rel=0.01)
    moving = Poses(10.0 * np.arange(3.0)[:, None] * np.eye(3)[0], quaternions, np.ones(3))
    found = curve_through(moving).at_fractions(np.linspace(0, 1, 100)).centers
    np.testing.assert_allclose(np.diff(found[:, 0]), 20 / 99, rtol=1e-3)


def test_a_zoom_on_the_spot_takes_its_time_and_leaves_the_camera_there():
    """Frames had the last focal length from the first one on, for the way was nothing."""
    focals = np.array([0.5, 0.5, 2.0, 2.0])
    for centers in (np.zeros((4, 3)), np.array([0.0, 1.0, 1.0, 2.0])[:, None] * np.eye(3)[0]):
        keys = Poses(centers, still(centers).quaternions, focals)
        found = curve_through(keys).at_fractions(np.linspace(0, 1, 200))
        way = ZOOM * np.log(4.0) + np.ptp(centers[:, 0])
        assert ways_between(found).max() == pytest.approx(way / 199, rel=0.01)
        zooming = (found.focals > 0.51) & (found.focals < 1.99)
        np.testing.assert_allclose(found.centers[zooming], centers[[1] * zooming.sum()], atol=1e-3)


def test_a_closed_curve_returns_without_a_corner():
    curve = curve_through(any_poses(6), closed=True)
    ends = curve.at(curve.key_knots[[0, -1]])
    np.testing.assert_allclose(ends.centers[0], ends.centers[1], atol=1e-12)
    assert angles_between(ends.quaternions[:1], ends.quaternions[1:])[0] < 1e-7
    start, end = curve.key_knots[[0, -1]]
    h = 1e-6 * (end - start)
    near = curve.at(np.array([start, start + h, end - h, end]))
    first, last = near.centers[1] - near.centers[0], near.centers[3] - near.centers[2]
    np.testing.assert_allclose(first, last, rtol=1e-3, atol=1e-9)


def test_the_derivative_is_continuous_at_key_frames():
    curve = curve_through(any_poses(9))
    inner = curve.key_knots[1:-1]
    h = 1e-6
    before, at, after = (curve.at(inner + step).centers for step in (-h, 0, h))
    np.testing.assert_allclose((at - before) / h, (after - at) / h, rtol=1e-3, atol=1e-3)


def test_a_straight_line_stays_straight_whatever_the_gaps():
    line = np.outer(np.array([0, 1, 1.01, 7, 30.0]), [1.0, 2.0, -2.0])
    found = curve_through(still(line)).at_fractions(FRACTIONS).centers
    assert np.abs(np.cross(found, [1.0, 2.0, -2.0])).max() < 1e-9
    assert (np.diff(found[:, 0]) > 0).all(), "and never goes back"


@given(st.floats(0, 1), st.floats(0, 1))
def test_easing_begins_and_ends_with_the_path_and_is_symmetric(easing, time):
    way = eased(np.array([0.0, time, 1 - time, 1.0]), easing)
    assert way[0] == 0
    assert way[3] == pytest.approx(1)
    assert way[1] == pytest.approx(1 - way[2], abs=1e-9)
    assert (np.diff(eased(FRACTIONS, easing)) >= -1e-12).all()


@pytest.mark.parametrize("easing", [0.2, 0.5, 1.0])
def test_easing_starts_and_stops_still_and_is_even_between(easing):
    speed = np.diff(eased(np.linspace(0, 1, 10001), easing)) * 10000
    assert max(speed[0], speed[-1]) < 0.01
    between = speed[int(5000 * easing) + 1 : 10000 - int(5000 * easing) - 1]
    assert np.ptp(between) < 1e-6 if len(between) else speed.max() == pytest.approx(2, abs=1e-3)


@settings(deadline=None)
@given(st.lists(st.sampled_from([0.0, 1e-12, 1.0, 1e6]), min_size=1, max_size=6), st.booleans())
def test_key_frames_at_one_place_or_far_apart_give_a_finite_curve(steps, closed):
    centers = np.cumsum(steps)[:, None] * np.ones(3)
    found = curve_through(still(centers), closed=closed).at_fractions(FRACTIONS)
    for values in (found.centers, found.quaternions, found.focals):
        assert np.isfinite(values).all()


def test_one_key_frame_is_a_curve_that_stays_there():
    keys = any_poses(1)
    curve: CameraCurve = curve_through(keys)
    assert_same(curve.at_fractions(np.array([0.0, 0.5, 1.0])), any_repeat(keys, 3))


def any_repeat(poses: Poses, n: int) -> Poses:
    return Poses(
        *(
            np.repeat(values, n, axis=0)
            for values in (poses.centers, poses.quaternions, poses.focals)
        )
    )
