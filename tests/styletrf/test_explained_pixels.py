"""What a box around the points can explain of photographs."""

import numpy as np
import pytest
from captures import arc
from test_free_space import seen

from styletrf.explained_pixels import explained_pixels
from styletrf.scene_model import BOX_EXPLAINS, SceneModelConfig, decide_scene_model

RNG = np.random.default_rng(0)
CAMERAS = arc(20, n=8)
SURFACE = RNG.uniform(-1, 1, (3000, 3))  # fills the views
OBJECT = 0.25 * SURFACE  # in the middle of them


def textured() -> np.ndarray:
    return RNG.random((45, 60, 3)).astype(np.float32)


def cut_out(camera, points, ground: float) -> np.ndarray:
    """Texture where points are, one flat gray elsewhere."""
    image = np.full((45, 60, 3), ground, np.float32)
    pixels = seen([camera], points).observed_pixel.astype(int)
    image[pixels[:, 1], pixels[:, 0]] = RNG.random((len(pixels), 3))
    return image


def explained(images, points) -> float:
    return explained_pixels(iter(images), CAMERAS, seen(CAMERAS, points))


def test_box_explains_photographs_that_are_full_of_its_points():
    assert explained([textured() for _ in CAMERAS], 3 * SURFACE) > 0.97


def test_box_explains_an_object_cut_out_on_one_color():
    assert explained([cut_out(c, OBJECT, 1.0) for c in CAMERAS], OBJECT) > 0.97


def test_box_does_not_explain_texture_without_points():
    assert explained([textured() for _ in CAMERAS], OBJECT) < 0.6


def test_grounds_of_different_colors_are_not_one():
    grounds = np.linspace(0.1, 0.9, len(CAMERAS))
    images = [cut_out(c, OBJECT, g) for c, g in zip(CAMERAS, grounds, strict=True)]
    assert explained(images, OBJECT) < 0.7


@pytest.mark.parametrize(("share", "kind"), [(BOX_EXPLAINS - 0.01, "unbounded"), (1.0, "box")])
def test_space_reaches_beyond_a_box_that_explains_too_little(share, kind):
    model = decide_scene_model(arc(20), 0.5 * SURFACE, SceneModelConfig(), explained=share)
    assert model.space.kind == kind
    assert model.evidence["space"]["explained_by_box"] == share
