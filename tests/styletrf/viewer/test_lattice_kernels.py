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

RESOLUTION = (17, 9, 21)


@pytest.mark.parametrize("share", [0.05, 1.0])
def test_an_interpolated_value_is_the_sum_by_trilinear_weights(share):
    rng = np.random.default_rng(0)
    occupied = rng.random((6, 5, 7)) < share
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


def test_the_installation_compiles_what_baking_runs(content):
    kernels = (
        lattice_kernels.interpolated, lattice_kernels.add_squares, lattice_kernels.multiples,
        refit_kernels.totals, refit_kernels.lacking,
    )  # fmt: skip
    compile_viewer_kernels()
    content("box")
    assert [len(kernel.signatures) for kernel in kernels] == [1] * len(kernels)
