"""What a box around the points can explain of photographs."""

import numpy as np
import pytest
from captures import arc, seen

from styletrf.scene.explained_pixels import ExplainedPixels, explained_pixels
from styletrf.scene.scene_model import BOX_EXPLAINS, SceneModelConfig, decide_scene_model

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


def of_pixels(images, points, masks=None):
    masks = masks or [None] * len(CAMERAS)
    return explained_pixels(iter(images), CAMERAS, seen(CAMERAS, points), iter(masks))


def explained(images, points, masks=None) -> float:
    return of_pixels(images, points, masks).by_box


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


def shown_by(camera, points) -> np.ndarray:
    """Which pixels lie in a tile that shows points."""
    pixels = seen([camera], points).observed_pixel
    tiles = np.zeros((12, 16), bool)
    tiles[(pixels[:, 1] * 12 // 45).astype(int), (pixels[:, 0] * 16 // 60).astype(int)] = True
    return np.asarray(tiles[np.arange(45)[:, None] * 12 // 45, np.arange(60) * 16 // 60])


def test_masked_pixels_that_a_box_does_not_explain_do_not_count():
    images = [textured() for _ in CAMERAS]
    assert explained(images, OBJECT) < 0.6
    assert explained(images, OBJECT, [shown_by(c, OBJECT) for c in CAMERAS]) > 0.97


def test_masked_pixels_that_a_box_explains_do_not_count_either():
    images = [textured() for _ in CAMERAS]
    assert explained(images, OBJECT, [~shown_by(c, OBJECT) for c in CAMERAS]) < 0.3


def test_a_view_that_is_masked_all_over_is_left_out():
    images = [cut_out(c, OBJECT, 1.0) for c in CAMERAS]
    others = [None] * (len(CAMERAS) - 1)
    black = [np.zeros((45, 60), bool), *others]
    rest = seen(CAMERAS, OBJECT).of_images(range(1, len(CAMERAS)))
    alone = explained_pixels(images[1:], CAMERAS[1:], rest, others).by_box
    for first in (images[0], textured(), np.zeros((45, 60, 3), np.float32)):
        assert explained([first, *images[1:]], OBJECT, black) == pytest.approx(alone, abs=0.01)


def test_nothing_speaks_against_a_box_where_no_pixel_counts():
    black = [np.zeros((45, 60), bool) for _ in CAMERAS]
    assert explained([textured() for _ in CAMERAS], OBJECT, black) == 1.0


def test_a_masked_part_of_a_tile_does_not_change_its_color():
    """A white ground beside which people walk: half of every tile is masked texture."""
    stripes = np.broadcast_to(np.arange(60) % 2 == 0, (45, 60))
    images = [cut_out(c, OBJECT, 1.0) for c in CAMERAS]
    spoiled = [np.where(stripes[..., None], image, textured()) for image in images]
    assert explained(spoiled, OBJECT) < 0.7
    assert explained(spoiled, OBJECT, [stripes] * len(CAMERAS)) > 0.97


@pytest.mark.parametrize(("fraction", "kind"), [(BOX_EXPLAINS - 0.01, "unbounded"), (1.0, "box")])
def test_space_reaches_beyond_a_box_that_explains_too_little(fraction, kind):
    by_points = ExplainedPixels(by_points=fraction)
    model = decide_scene_model(arc(20), 0.5 * SURFACE, SceneModelConfig(), explained=by_points)
    assert model.space.kind == kind
    assert model.evidence["space"]["explained_by_box"] == fraction


def test_an_object_on_a_ground_of_one_color_is_cut_out():
    assert of_pixels([cut_out(c, OBJECT, 1.0) for c in CAMERAS], OBJECT).is_cut_out


@pytest.mark.parametrize("points", [OBJECT, 3 * SURFACE])
def test_an_object_before_texture_is_not_cut_out_wherever_points_are(points):
    assert not of_pixels([textured() for _ in CAMERAS], points).is_cut_out


def test_a_cut_out_object_gets_a_box_at_every_bound_on_voxels():
    """Coarse voxels are no reason to look for more than the photographs show."""
    cut = ExplainedPixels(by_points=0.6, by_ground=0.39)
    full = ExplainedPixels(by_points=0.99)
    dense_in_the_middle = np.concatenate([OBJECT, SURFACE[:300]])
    chosen = {}
    for explained_by in (cut, full):
        for side in (16, 32, 64, 512):
            config = SceneModelConfig(max_voxels=side**3)
            model = decide_scene_model(arc(20), dense_in_the_middle, config, explained=explained_by)
            chosen.setdefault(explained_by, set()).add(model.space.kind)
    assert chosen == {cut: {"box"}, full: {"box", "unbounded"}}
