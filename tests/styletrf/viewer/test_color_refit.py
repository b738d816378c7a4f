"""Colors that depend on the view, fitted by a base and a slope at lattice points."""

from copy import deepcopy

import pytest

from styletrf.viewer.baked_appearance import BakedAppearance
from styletrf.viewer.baking_loss import baking_loss
from styletrf.viewer.color_refit import RefitConfig, refitted_colors
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
