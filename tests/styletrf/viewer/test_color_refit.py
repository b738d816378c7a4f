"""Colors that depend on the view, fitted by a base and a slope at lattice points."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
import torch
from mini_scene import KERNELS

from styletrf.viewer.baked_appearance import BakedAppearance
from styletrf.viewer.baking_loss import baking_loss
from styletrf.viewer.color_refit import RefitConfig, refitted_colors
from styletrf.viewer.view_directions import MONOMIALS, view_directions
from styletrf.viewer.viewer_content import RENDER
from styletrf.viewer.visibility import Views


@pytest.fixture(scope="module")
def of_the_form(tiny, content):
    """A field whose colors are a base and a slope, its views, and the lattice of these."""
    scene, look = tiny("box"), content("box").looks[0]
    field = deepcopy(scene.fields["Photographs"])
    field.appearance = look.appearance()
    field.appearance.background = field.appearance.background_color()  # renders ask for its device
    return field, Views(scene.model.space, scene.cameras, RENDER), look.lattice


@pytest.fixture(scope="module")
def of_the_form_with_a_tint(of_the_form):
    """The same, redder along one axis of the directions and bluer along the other way."""
    field, views, lattice = of_the_form
    directions = view_directions(views, field.step_length)
    tint = np.zeros_like(directions.tint)
    tint[MONOMIALS.index((0,))] = 0.2, 0.0, -0.2
    tint[MONOMIALS.index((1, 1))] = 0.0, 0.1, 0.0
    tinted, base = deepcopy(field), field.appearance.components(field_points(lattice), KERNELS)
    tinted.appearance = BakedAppearance(
        lattice, base.numpy()[:, :3], 1.0, field.appearance.background_color(),
        np.zeros((len(base), 3), np.float32), replace(directions, tint=tint),
    )  # fmt: skip
    tinted.appearance.background = field.appearance.background
    return tinted, views, lattice


def field_points(lattice) -> torch.Tensor:
    points = 2 * lattice.points() / (np.array(lattice.resolution) - 1) - 1
    return torch.from_numpy(points.astype(np.float32))


def fitted_db(of_the_form, **config) -> float:
    field, views, lattice = of_the_form
    found = refitted_colors(field, views, lattice, RefitConfig(samples=500_000, **config))
    appearance = BakedAppearance(
        lattice, found.base, field.appearance.weight_power, field.appearance.background_color(),
        found.slope, found.directions,
    )  # fmt: skip
    return baking_loss(field, views, appearance=appearance).mean_db


@pytest.mark.parametrize("of_samples", [0.0, 0.2, 1.0])
def test_colors_of_the_form_that_is_fitted_are_found(of_the_form, of_samples):
    none, some, many = (
        fitted_db(of_the_form, passes=passes, of_samples=of_samples, prior=1e-3)
        for passes in (0, 2, 16)
    )
    assert none + 3 < some < many


def test_a_tint_that_all_colors_have_is_found(of_the_form_with_a_tint):
    field, views, lattice = of_the_form_with_a_tint
    config = RefitConfig(samples=500_000, passes=16, prior=1e-3)
    found = refitted_colors(field, views, lattice, config)
    without = replace(found.directions, tint=np.zeros_like(found.directions.tint))
    with_tint, no_tint = (
        baking_loss(
            field, views, appearance=BakedAppearance(
                lattice, found.base, 1.0, field.appearance.background_color(), found.slope, each,
            ),
        ).mean_db
        for each in (found.directions, without)
    )  # fmt: skip
    assert with_tint > 40
    assert no_tint + 10 < with_tint


def test_of_two_cameras_colors_are_found_as_well(of_the_form):
    field, views, lattice = of_the_form
    two = field, replace(views, cameras=views.cameras[:2]), lattice
    start, end = (fitted_db(two, passes=passes) for passes in (0, RefitConfig().passes))
    assert start + 3 < end
