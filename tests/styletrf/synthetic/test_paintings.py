"""The shipped style images are what the code paints: full of strokes, colorful, all unlike."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from styletrf.synthetic.paintings import PAINTINGS, stained_glass
from styletrf.synthetic.paintings.__main__ import main

SHIPPED = Path(__file__).parents[3] / "data" / "styles"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("styles")
    assert main([str(folder / "new")]) == 0
    return {path.stem: path for path in (folder / "new").iterdir()}


def read(path):
    image = cv2.imread(str(path))
    assert image is not None
    return image.astype(np.float64)


def test_the_command_makes_every_painting(made):
    assert sorted(made) == sorted(PAINTINGS)


@pytest.mark.parametrize("name", PAINTINGS)
def test_the_shipped_image_is_the_one_the_code_paints(made, name):
    # Other processors round otherwise, and JPEG then moves single values a little.
    assert np.abs(read(made[name]) - read(SHIPPED / f"{name}.jpg")).mean() < 1.0


@pytest.mark.parametrize("name", PAINTINGS)
def test_a_shipped_image_is_small_square_and_colorful(name):
    path = SHIPPED / f"{name}.jpg"
    image = read(path)
    assert path.stat().st_size < 250_000
    assert image.shape == (512, 512, 3)
    assert np.mean(image.max(axis=-1) - image.min(axis=-1)) > 50


@pytest.mark.parametrize("name", PAINTINGS)
def test_strokes_are_everywhere_at_their_scale(name):
    gray = cv2.cvtColor(cv2.imread(str(SHIPPED / f"{name}.jpg")), cv2.COLOR_BGR2GRAY)
    band = cv2.GaussianBlur(gray.astype(float), (0, 0), 1.5)
    band = band - cv2.GaussianBlur(band, (0, 0), 20)
    energy = np.sqrt(cv2.boxFilter(band**2, -1, (128, 128))[64:-64, 64:-64])
    assert energy.min() > 4
    assert energy.mean() > 10


def test_the_paintings_differ_in_color_and_texture(made):
    images = [read(made[name]) for name in PAINTINGS]
    for i, a in enumerate(images):
        for b in images[:i]:
            assert np.abs(a - b).mean() > 40


def test_stained_glass_is_leaded(made):
    dark = read(made["stained_glass"]).max(axis=-1) < 60
    assert 0.1 < dark.mean() < 0.4


def test_a_seed_makes_one_painting(made):
    first = stained_glass(5)
    np.testing.assert_array_equal(first, stained_glass(5))
    of_another_seed = read(made["stained_glass"])[..., ::-1]
    assert np.abs(first - of_another_seed).mean() > 20  # the same picture in other pieces
