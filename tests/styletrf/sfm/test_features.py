"""Features of photographs in a database of COLMAP's."""

from contextlib import closing

import numpy as np
import pycolmap
import pytest
from made_photographs import encoded, texture

from styletrf.progress import silent
from styletrf.sfm.colmap_images import ColmapImages, LensSetting
from styletrf.sfm.colmap_mapping import extract_features

SIZE = 256
MANY, FEW = 100_000, 32


@pytest.fixture(scope="module")
def images(tmp_path_factory):
    """Six photographs of noise, of which each has hundreds of features of several pixels."""
    folder = tmp_path_factory.mktemp("features") / "images"
    folder.mkdir()
    files = tuple(f"{seed:06d}.png" for seed in range(6))
    for seed, file in enumerate(files):
        (folder / file).write_bytes(encoded(texture(SIZE, SIZE, seed), ".png"))
    return ColmapImages(folder, files, SIZE, (LensSetting(files, None),))


def keypoints(images, database, most, octave):
    """The features of each image, as they were found from an octave on."""
    extract_features(database, images, "SIMPLE_RADIAL", most, silent, octave)
    with closing(pycolmap.Database.open(database)) as opened:
        return [opened.read_keypoints(image.image_id) for image in opened.read_all_images()]


def test_fine_features_are_not_looked_for_where_larger_ones_suffice(images, tmp_path):
    found = keypoints(images, tmp_path / "auto.db", FEW, None)
    coarse = keypoints(images, tmp_path / "coarse.db", FEW, 0)
    fine = keypoints(images, tmp_path / "fine.db", FEW, -1)
    for some, larger, all_of_them in zip(found, coarse, fine, strict=True):
        np.testing.assert_array_equal(some, larger)
        apart = np.linalg.norm(some[:, None, :2] - all_of_them[None, :, :2], axis=-1).min(axis=1)
        assert np.mean(apart < 0.1) > 0.8, "those of the image at twice its size are dropped"


def test_fine_features_are_looked_for_where_all_are_wanted(images, tmp_path):
    found = keypoints(images, tmp_path / "auto.db", MANY, None)
    fine = keypoints(images, tmp_path / "fine.db", MANY, -1)
    coarse = keypoints(images, tmp_path / "coarse.db", MANY, 0)
    for some, all_of_them, larger in zip(found, fine, coarse, strict=True):
        np.testing.assert_array_equal(some, all_of_them)
        assert len(some) > len(larger)
