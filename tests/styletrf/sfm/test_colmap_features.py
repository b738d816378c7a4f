"""Features, cameras and images as they stand in a database of COLMAP's."""

from contextlib import closing

import cv2
import numpy as np
import pycolmap
import pytest
from made_photographs import encoded, texture

from styletrf.progress import silent
from styletrf.sfm.colmap_features import (
    extract_features,
    extract_stronger_features,
    image_ids,
    read_descriptors,
    read_largest_descriptors,
)
from styletrf.sfm.colmap_images import ColmapImages
from styletrf.sfm.colmap_mapping import match_pairs, panorama_pairs
from styletrf.sfm.lens_settings import LensSetting
from styletrf.sfm.matching.image_pairs import all_pairs
from styletrf.sfm.matching.sift_features import sift_features

SIZE, MOST, BLANK = 128, 200, 2
FOCALS_PX = {"wide": 90.0, "tele": 300.0}


@pytest.fixture
def images(tmp_path):
    """Four photographs, one blank, taken with two lenses whose files are not in order."""
    folder, masks = tmp_path / "images", tmp_path / "masks"
    folder.mkdir()
    masks.mkdir()
    files = tuple(f"{seed:06d}.png" for seed in range(4))
    for seed, file in enumerate(files):
        image = texture(SIZE, SIZE, seed % 3)
        (folder / file).write_bytes(encoded(image if seed != BLANK else 0 * image, ".png"))
    black = np.zeros((SIZE, SIZE, 3), np.uint8)
    black[:, : SIZE // 2] = 255
    (masks / f"{files[1]}.png").write_bytes(encoded(black, ".png"))
    lenses = (
        LensSetting((files[1], files[3]), FOCALS_PX["wide"]),
        LensSetting((files[0], files[2]), FOCALS_PX["tele"]),
    )
    return ColmapImages(folder, files, SIZE, lenses, masks)


@pytest.fixture
def database(images, tmp_path):
    path = tmp_path / "colmap.db"
    extract_features(path, images, "SIMPLE_RADIAL", MOST, silent)
    return path


def test_each_image_has_its_own_features(images, database):
    with closing(pycolmap.Database.open(database)) as opened:
        for file, number in zip(images.files, image_ids(opened, images), strict=True):
            image = cv2.imread(str(images.folder / file), cv2.IMREAD_COLOR)
            mask = images.mask_of(file)
            counts = None if mask is None else cv2.imread(str(mask), cv2.IMREAD_GRAYSCALE)
            own = sift_features(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), MOST, counts)
            np.testing.assert_array_equal(read_descriptors(opened, number), own.descriptors)
            if len(own.keypoints):
                np.testing.assert_array_equal(opened.read_keypoints(number), own.keypoints)


@pytest.mark.parametrize("extract", [extract_features, extract_stronger_features])
def test_images_without_a_mask_among_masked_ones_have_features(images, tmp_path, extract):
    path = tmp_path / "masked.db"
    extract(path, images, "SIMPLE_RADIAL", MOST, silent)
    with closing(pycolmap.Database.open(path)) as opened:
        counts = [len(read_descriptors(opened, number)) for number in image_ids(opened, images)]
    assert counts[BLANK] == 0
    assert 0 < counts[1] < min(counts[0], counts[3])


@pytest.mark.parametrize("extract", [extract_features, extract_stronger_features])
def test_cameras_start_from_the_focal_lengths_of_their_settings(images, tmp_path, extract):
    path = tmp_path / "focal.db"
    extract(path, images, "SIMPLE_RADIAL", MOST, silent)
    with closing(pycolmap.Database.open(path)) as opened:
        camera = {image.name: image.camera_id for image in opened.read_all_images()}
        focal = {name: opened.read_camera(number).params[0] for name, number in camera.items()}
    wide, tele = FOCALS_PX["wide"], FOCALS_PX["tele"]
    assert [focal[file] for file in images.files] == [tele, wide, tele, wide]


def test_the_largest_features_come_first_and_a_blank_image_has_none(images, database):
    with closing(pycolmap.Database.open(database)) as opened:
        ids = image_ids(opened, images)
        for number in ids:
            first = read_descriptors(opened, number)[:20]
            np.testing.assert_array_equal(read_largest_descriptors(opened, number, 20), first)
        assert len(read_largest_descriptors(opened, ids[BLANK], 20)) == 0


def test_the_largest_affine_features_are_those_of_the_largest_area(images, tmp_path):
    path = tmp_path / "stronger.db"
    extract_stronger_features(path, images, "SIMPLE_RADIAL", MOST, silent)
    with closing(pycolmap.Database.open(path)) as opened:
        number = image_ids(opened, images)[0]
        shapes = np.asarray(opened.read_keypoints(number))[:, 2:].reshape(-1, 2, 2)
        largest = np.abs(np.linalg.det(shapes)).argmax()
        (found,) = read_largest_descriptors(opened, number, 1)
        np.testing.assert_array_equal(found, read_descriptors(opened, number)[largest])


def test_matching_twice_changes_nothing(images, database):
    """The first and the last photograph are the same, and the only ones that match."""
    verified = match_pairs(database, images, all_pairs(4), 0, silent)
    with closing(pycolmap.Database.open(database)) as opened:
        ids = image_ids(opened, images)
        matches = opened.read_matches(ids[0], ids[3])
    np.testing.assert_array_equal(matches[:, 0], matches[:, 1])
    assert len(matches) > 50
    assert match_pairs(database, images, all_pairs(4), 0, silent) == verified == 1


def test_views_of_one_panorama_are_not_matched(images, database):
    views = ColmapImages(
        images.folder, images.files, SIZE, images.lenses,
        panoramas=((images.files[3], images.files[0]), (images.files[1], images.files[2])),
    )  # fmt: skip
    assert panorama_pairs(views) == [(0, 3), (1, 2)]
    assert match_pairs(database, views, all_pairs(4), 0, silent) == 0
    with closing(pycolmap.Database.open(database)) as opened:
        ids = image_ids(opened, views)
        assert not opened.exists_matches(ids[0], ids[3])
        assert opened.exists_matches(ids[0], ids[1])
