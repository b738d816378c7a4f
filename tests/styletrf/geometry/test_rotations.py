"""Quaternions: to matrices and back, and arcs that begin and end where they should."""

import numpy as np
import pytest
from quaternions import about, any_quaternions

from styletrf.geometry.rotations import aligned, angles_between, matrices_of, quaternions_of, slerp


def test_matrices_and_back_are_the_same_rotation():
    given = any_quaternions()
    rotations = matrices_of(given)
    np.testing.assert_allclose(
        rotations @ rotations.transpose(0, 2, 1), np.eye(3)[None] + 0 * rotations, atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(rotations), 1)
    assert angles_between(quaternions_of(rotations), given).max() < 1e-7
    np.testing.assert_allclose(matrices_of(quaternions_of(rotations)), rotations, atol=1e-12)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("angle_deg", [0, 1e-6, 90, 179.999999, 180])
def test_turns_about_an_axis_are_found_up_to_half_a_turn(axis, angle_deg):
    given = about(axis, np.radians(angle_deg))
    found = quaternions_of(matrices_of(given))
    assert angles_between(found, given)[0] < 1e-7
    assert angles_between(found, about(axis, 0.0))[0] == pytest.approx(np.radians(angle_deg))


def test_an_arc_begins_and_ends_exactly_and_turns_evenly():
    a, b = (
        aligned(np.stack([any_quaternions(2, seed=k) for k in range(50)]).reshape(-1, 4))
        .reshape(50, 2, 4)
        .transpose(1, 0, 2)
    )
    b = np.where((a * b).sum(axis=1, keepdims=True) < 0, -b, b)
    np.testing.assert_allclose(slerp(a, b, np.zeros((50, 1))), a, atol=1e-15)
    np.testing.assert_allclose(slerp(a, b, np.ones((50, 1))), b, atol=1e-15)
    for fraction in (-0.5, 0.2, 0.5, 1.5):
        middle = slerp(a, b, np.full((50, 1), fraction))
        np.testing.assert_allclose(np.linalg.norm(middle, axis=1), 1)
        whole = 2 * np.arccos(np.clip((a * b).sum(axis=1), -1, 1))
        turned = 2 * np.arccos(np.clip((a * middle).sum(axis=1), -1, 1))
        np.testing.assert_allclose(turned, abs(fraction) * whole, atol=1e-6)


def test_an_arc_between_the_same_or_opposite_quaternions_is_finite():
    a = any_quaternions(20)
    for b in (a, -a, a + 1e-12):
        assert np.isfinite(slerp(a, b, np.full((20, 1), 0.3))).all()


def test_alignment_leaves_no_neighbors_more_than_half_a_turn_apart():
    found = aligned(any_quaternions())
    assert ((found[1:] * found[:-1]).sum(axis=1) >= 0).all()
    assert angles_between(found, any_quaternions()).max() < 1e-7
