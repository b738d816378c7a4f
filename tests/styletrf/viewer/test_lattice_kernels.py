"""Compiled sums over lattice points are those of their definitions."""

import numpy as np
import pytest
import torch
from lattice_positions import corners, positions_in
from mini_scene import KERNELS

from styletrf.kernel_compilation import compile_viewer_kernels
from styletrf.viewer import lattice_kernels, refit_kernels
from styletrf.viewer.baked_appearance import BakedAppearance
from styletrf.viewer.lattice import brick_lattice, occupied_cells
from styletrf.viewer.view_directions import MONOMIALS

RESOLUTION = (17, 9, 21)


@pytest.mark.parametrize("corner_weight", [0.05, 1.0])
def test_an_interpolated_value_is_the_sum_by_trilinear_weights(corner_weight):
    rng = np.random.default_rng(0)
    occupied = rng.random((6, 5, 7)) < corner_weight
    lattice = brick_lattice(occupied_cells(occupied, RESOLUTION), RESOLUTION)
    values = rng.normal(size=(lattice.needed.size, 3)).astype(np.float32)
    at = rng.uniform(-1.1, 1.1, (200, 3))  # some outside, and some where no point is stored
    of_points, weights = corners(lattice, at)
    weights = np.where(of_points < 0, 0, weights)
    expected = (weights[..., None] * values[of_points]).sum(axis=1)
    appearance = BakedAppearance(lattice, values, 1.0, torch.zeros(3))
    shown = appearance.components(torch.from_numpy(at.astype(np.float32)), KERNELS)
    np.testing.assert_allclose(shown, expected, atol=1e-4)


def test_squares_are_the_greatest_of_the_sums_of_pictures():
    rng = np.random.default_rng(0)
    occupied = np.ones((2, 2, 2), bool)
    lattice = brick_lattice(occupied_cells(occupied, RESOLUTION), RESOLUTION)
    sums = np.zeros((lattice.needed.size, 3), np.float32)
    expected = np.zeros(lattice.needed.size)
    for picture in (1, 2, 3):
        at = positions_in(occupied, picture)
        of_samples = rng.random(len(at)).astype(np.float32)
        low, rest = lattice.cells(at)
        samples = lattice.slots, low, rest.astype(np.float32), of_samples
        lattice_kernels.add_squares(*samples, picture, sums)
        of_points, weights = corners(lattice, at)
        of_picture = np.zeros_like(expected)
        np.add.at(of_picture, of_points, (of_samples[:, None] * weights) ** 2)
        expected = np.maximum(expected, of_picture)
    np.testing.assert_allclose(sums[:, 1:].max(axis=1), expected, rtol=1e-4, atol=1e-9)


def test_the_equations_of_a_tint_are_of_the_derivatives_of_what_rays_lack():
    rng = np.random.default_rng(0)
    occupied = np.ones((2, 2, 2), bool)
    lattice = brick_lattice(occupied_cells(occupied, RESOLUTION), RESOLUTION)
    at = positions_in(occupied, 1)
    starts = np.array([0, 5, 6, 20, len(at)])
    weights, colors = rng.random(len(at)), rng.random((len(at), 3))
    values = rng.normal(size=(lattice.needed.size, 6)) * 0.2
    turned, tint = rng.normal(size=(4, 3)), 0.1 * rng.normal(size=(len(MONOMIALS), 3))
    low, rest = lattice.cells(at)
    of_points, corner_weights = corners(lattice, at)
    inside = torch.from_numpy((corner_weights[..., None] * values[of_points]).sum(axis=1))
    ray = torch.from_numpy(np.repeat(np.arange(4), np.diff(starts)))
    monomials = torch.from_numpy(np.stack([turned[:, list(m)].prod(axis=1) for m in MONOMIALS], 1))

    def residuals(tint: torch.Tensor) -> torch.Tensor:
        gain = (inside[:, 3:] * torch.from_numpy(turned)[ray]).sum(dim=1, keepdim=True)
        shown = torch.sigmoid(inside[:, :3] + gain + (monomials @ tint)[ray])
        missing = torch.from_numpy(weights)[:, None] * (torch.from_numpy(colors) - shown)
        return torch.zeros(4, 3, dtype=torch.float64).index_add(0, ray, missing)

    jacobian = -torch.autograd.functional.jacobian(residuals, torch.from_numpy(tint))
    of_channels = [jacobian[:, k, :, k] for k in range(3)]
    squares = torch.stack([each.T @ each for each in of_channels])
    right = [each.T @ residuals(torch.from_numpy(tint))[:, k] for k, each in enumerate(of_channels)]
    _, found = refit_kernels.residuals(
        lattice.slots, low.astype(np.int16), *(part.astype(np.float32) for part in (rest, weights)),
        colors.astype(np.float32), starts, turned.astype(np.float32), tint.astype(np.float32), 1,
        values.astype(np.float32), np.float32(0.2),
        np.empty((refit_kernels.BANDS, *values.shape), np.float32),
    )  # fmt: skip
    np.testing.assert_allclose(found[..., :-1], squares.triu(), rtol=1e-3, atol=1e-5)
    np.testing.assert_allclose(found[..., -1], torch.stack(right), rtol=1e-3, atol=1e-5)


def test_the_installation_compiles_what_baking_runs(content):
    kernels = (
        lattice_kernels.interpolated, lattice_kernels.add_squares, lattice_kernels.multiples,
        refit_kernels.totals, refit_kernels.residuals,
    )  # fmt: skip
    compile_viewer_kernels()
    content("box")
    assert [len(kernel.signatures) for kernel in kernels] == [1] * len(kernels)
