import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from expected_errors import rejects
from made_panoramas import courtyard_panoramas, with_xmp
from made_photographs import encoded, texture
from message_words import mentions

from styletrf.capture.panorama.panoramas import (
    find_panoramas,
    fraction_of_directions,
    panorama_mismatch,
    show_panoramas,
)
from styletrf.capture.photographs import PHOTOGRAPH_SUFFIXES, read_photograph
from styletrf.capture.scene_capture import capture_photographs
from styletrf.errors import InputError
from styletrf.synthetic.courtyard import CourtyardConfig, courtyard_cameras, render_view

WIDTH = 512


@pytest.fixture(scope="module")
def panoramas():
    return courtyard_panoramas(4, WIDTH)[1]


def crops(image):
    """Returns the upper, middle and lower part of a photograph that is twice as wide as high."""
    height, width = image.shape[:2]
    high = min(height, width // 2)
    starts = {0, (height - high) // 2, height - high}
    return [image[start : start + high, : 2 * high] for start in starts]


def found(folder, images, choice="auto", suffix=".png"):
    """Returns the numbers of the images that are found to be panoramas."""
    sizes = {}
    for index, image in enumerate(images):
        file = folder / f"{index}{suffix}"
        file.write_bytes(encoded(image, suffix))
        sizes[file] = image.shape[1], image.shape[0]
    return {int(file.stem) for file in find_panoramas(sizes, choice)}


def test_panoramas_are_found_by_their_pixels_however_turned(panoramas, tmp_path):
    assert found(tmp_path, panoramas) == {0, 1, 2, 3}
    turned = [np.roll(image, 100 * k, axis=1) for k, image in enumerate(panoramas)]
    assert found(tmp_path, turned, suffix=".jpg") == {0, 1, 2, 3}


def test_photographs_cut_to_the_shape_of_a_panorama_are_found_to_be_none(tmp_path):
    config = CourtyardConfig(kind="walk", n_views=6, width=256, height=192)
    images = [render_view(camera, config)[0] for camera in courtyard_cameras(config)]
    assert found(tmp_path, [crop for image in images for crop in crops(image)]) == set()


@pytest.mark.parametrize("made", ["blank", "gradient", "object on a plain ground", "noise"])
def test_a_picture_that_shows_nothing_is_none(made):
    image = np.full((256, 512, 3), 255, np.uint8)
    if made == "gradient":
        image[:] = np.linspace(0, 255, 256).astype(np.uint8)[:, None, None]
    if made == "object on a plain ground":
        image[64:192, 128:384] = texture(128, 256)
    if made == "noise":
        image = texture(256, 512)
    assert not show_panoramas([panorama_mismatch(image)])


def test_a_panorama_cut_to_another_shape_is_none(panoramas):
    assert panorama_mismatch(panoramas[0][:-20]) == np.inf
    assert panorama_mismatch(panoramas[0][:, :-20]) == np.inf


def test_photographs_of_one_size_are_decided_together(panoramas, tmp_path):
    joint = panoramas[0].copy()
    joint[-1, : WIDTH // 2] = 255 - joint[-1, WIDTH // 2 :]
    assert not show_panoramas([panorama_mismatch(joint)])
    assert found(tmp_path, [*panoramas, joint]) == {0, 1, 2, 3, 4}
    other = texture(256, 512)
    assert found(tmp_path, [panoramas[0], *[other] * 2]) == set()


def test_a_setting_decides_what_is_a_panorama_instead_of_the_pixels(panoramas, tmp_path):
    assert found(tmp_path, panoramas, "no") == set()
    assert found(tmp_path, [texture(64, 128)], "yes") == {0}
    with rejects("0.png", "128x96"):
        found(tmp_path, [texture(96, 128)], "yes")


def test_metadata_say_what_no_picture_shows(tmp_path):
    file, other = tmp_path / "a.jpg", tmp_path / "b.jpg"
    plain = encoded(texture(64, 128))
    file.write_bytes(with_xmp(plain, ProjectionType="equirectangular"))
    other.write_bytes(with_xmp(plain, ProjectionType="cylindrical"))
    sizes = {file: (128, 64), other: (128, 64)}
    assert find_panoramas({file: (128, 64)}, "auto") == {file}
    assert find_panoramas({other: (128, 64)}, "auto") == set()
    assert find_panoramas(sizes, "no") == set()


SWEEP = {"CroppedAreaImageWidthPixels": 128, "FullPanoWidthPixels": 256}


LOW = {"CroppedAreaImageHeightPixels": 32, "FullPanoHeightPixels": 64}


@pytest.mark.parametrize(
    ("said", "fraction"), [(SWEEP, 0.5), (LOW, 0.5), (SWEEP | LOW, 0.25), ({}, 1.0)]
)
def test_the_share_of_directions_is_what_the_metadata_say(said, fraction, tmp_path):
    file = tmp_path / "a.jpg"
    file.write_bytes(with_xmp(encoded(texture(64, 128)), ProjectionType="equirectangular", **said))
    assert fraction_of_directions(file) == fraction


def test_a_sweep_among_photographs_is_left_out(tmp_path):
    """It refused the whole scene."""
    (tmp_path / "images").mkdir()
    for k in range(4):
        (tmp_path / "images" / f"{k}.jpg").write_bytes(encoded(texture(16, 24, k)))
    sweep = with_xmp(encoded(texture(64, 128)), ProjectionType="equirectangular", **SWEEP)
    (tmp_path / "images/sweep.jpg").write_bytes(sweep)
    capture = capture_photographs(tmp_path / "images", tmp_path / "auto")
    assert [one.name for one in capture.photographs] == [*"0123"]
    assert mentions(capture.warnings[0], "sweep.jpg", "50%")
    assert find_panoramas({tmp_path / "images/sweep.jpg": (128, 64)}, "auto") == set()
    capture = capture_photographs(tmp_path / "images", tmp_path / "no", panoramas="no")
    assert len(capture.photographs) == 5


def test_what_says_that_it_is_a_panorama_and_has_no_such_shape_is_refused(tmp_path):
    file, size = tmp_path / "a.jpg", (128, 40)
    file.write_bytes(with_xmp(encoded(texture(40, 128)), ProjectionType="equirectangular"))
    with rejects("a.jpg", "128x40"):
        find_panoramas({file: size}, "auto")


@pytest.mark.data
def test_no_crop_of_a_real_photograph_is_taken_for_a_panorama():
    root = os.environ.get("STYLETRF_DATA")
    if not root:
        pytest.skip("STYLETRF_DATA names no folder of real photographs")
    scenes = sorted(Path(root).glob("scenes/*/images")) + sorted(Path(root).glob("scenes/*/train"))
    mismatches = []
    for scene in scenes:
        files = sorted(f for f in scene.iterdir() if f.suffix.lower() in PHOTOGRAPH_SUFFIXES)
        for file in files[:: max(1, len(files) // 8)]:
            try:
                image = read_photograph(file)
            except InputError:
                continue  # a scene has damaged ones on purpose
            small = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
            mismatches += [panorama_mismatch(crop) for crop in [image, *crops(small)]]
    if not mismatches:
        pytest.skip(f"no photographs in {root}/scenes")
    assert min(mismatches) > 0.45
