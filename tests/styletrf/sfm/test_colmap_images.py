from pathlib import Path

import numpy as np
import pytest
from made_photographs import encoded, texture, with_exif

from styletrf.capture.photographs import read_photograph
from styletrf.capture.scene_capture import capture_photographs
from styletrf.files.images import write_png
from styletrf.progress import silent
from styletrf.sfm.colmap_images import prepare_images

PHONE = Path(__file__).parents[1] / "photographs" / "phone.heic"


def prepared(tmp_path, files, max_long_side=1000):
    (tmp_path / "in").mkdir(exist_ok=True)
    for name, data in files.items():
        (tmp_path / "in" / name).write_bytes(data)
    capture = capture_photographs(tmp_path / "in", tmp_path / "capture")
    return prepare_images(
        tmp_path / "capture", capture, tmp_path / "out", max_long_side, "auto", silent
    )


def views(suffix=".png", count=3):
    return [encoded(texture(48, 64, seed), suffix) for seed in range(count)]


def test_images_are_the_photographs_by_position(tmp_path):
    images = prepared(tmp_path, dict(zip(["b 10.png", "b 9.png", "a.png"], views(), strict=True)))
    for file, seed in zip(images.files, (2, 1, 0), strict=True):
        assert np.array_equal(read_photograph(images.folder / file), texture(48, 64, seed))
    assert (images.long_side, images.lenses[0].focal_prior_px) == (64, None)


@pytest.mark.parametrize(
    ("color", "counts"),
    [((0, 255, 0, 255), False), ((255, 255, 0, 255), True), ((255, 255, 255, 0), False)],
)
def test_a_mask_of_any_color_is_black_and_white_for_colmap(tmp_path, color, counts):
    """Green counted by its luminance, and by COLMAP's reader whatever is not black."""
    mask = np.full((48, 64, 4), 255, np.uint8)
    mask[:, :32] = color
    (tmp_path / "in" / "masks").mkdir(parents=True)
    (tmp_path / "in" / "masks" / "0.png").write_bytes(encoded(mask, ".png"))
    images = prepared(tmp_path, {f"{i}.png": data for i, data in enumerate(views())})
    written = read_photograph(images.mask_of(images.files[0]))
    assert np.array_equal(written[:, :32], np.full((48, 32, 3), 255 * counts))
    assert (written[:, 32:] == 255).all()


def test_large_photographs_are_reduced_to_the_side_asked_for(tmp_path):
    images = prepared(tmp_path, {f"{i}.png": data for i, data in enumerate(views())}, 32)
    assert images.long_side == 32
    assert read_photograph(images.folder / images.files[0]).shape == (24, 32, 3)


@pytest.mark.parametrize("max_long_side", [1000, 32])
def test_the_focal_length_of_exif_is_kept_in_pixels_of_the_images(tmp_path, max_long_side):
    """36 mm of film are 64 pixels, or 32 of the reduced image, to within the diagonal's share."""
    files = {f"{i}.jpg": with_exif(data, 6, 28) for i, data in enumerate(views(".jpg"))}
    images = prepared(tmp_path, files, max_long_side)
    assert images.long_side == min(64, max_long_side)
    focal_px = 28 / 36 * images.long_side
    assert images.lenses[0].focal_prior_px == pytest.approx(focal_px, rel=0.05)


@pytest.mark.parametrize("suffix", [".webp", ".tiff", ".ppm", ".bmp", ".jp2", ".png"])
def test_every_format_is_prepared_whether_or_not_colmap_reads_it(tmp_path, suffix):
    images = prepared(tmp_path, {f"{i}{suffix}": data for i, data in enumerate(views(suffix))})
    assert len(images.files) == 3
    assert images.lenses[0].focal_prior_px is None


def test_the_same_image_gives_the_same_bytes(tmp_path):
    for name in "ab":
        write_png(tmp_path / name, texture(8, 8), compression=3)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_photographs_keep_their_own_shapes_up_to_the_longest_side(tmp_path):
    files = {"0.png": texture(48, 64), "1.png": texture(64, 48), "2.png": texture(20, 30)}
    images = prepared(tmp_path, {name: encoded(i, ".png") for name, i in files.items()}, 32)
    shapes = [read_photograph(images.folder / file).shape[:2] for file in images.files]
    assert shapes == [(24, 32), (32, 24), (20, 30)]
    assert images.long_side == 32


def test_cameras_of_different_sizes_do_not_share_a_lens_once_both_are_reduced(tmp_path):
    """The photographs of two telephones had one focal length, since both were 1600 pixels wide."""
    files = {"0.png": (48, 64), "1.png": (72, 96), "2.png": (48, 64)}
    made = {n: encoded(texture(*files[n], seed), ".png") for seed, n in enumerate(files)}
    images = prepared(tmp_path, made, 32)
    assert [setting.files for setting in images.lenses] == [
        ("000000.png", "000002.png"),
        ("000001.png",),
    ]


def test_the_focal_length_of_a_telephones_photographs_is_read(tmp_path):
    """28 mm by the diagonal of film, 43.3 mm, for a diagonal of 80 pixels."""
    images = prepared(tmp_path, {f"{k}.heic": PHONE.read_bytes() + bytes([k]) for k in range(3)})
    assert images.lenses[0].focal_prior_px == pytest.approx(28 / np.hypot(36, 24) * 80)
