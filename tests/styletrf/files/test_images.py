import cv2
import numpy as np
import pytest
from expected_errors import rejects, stops

from styletrf.files.images import from_integers, read_rgb, to_integers, write_rgb


def every_level(bits):
    count = 2**bits
    return np.stack([np.arange(count), np.arange(count)[::-1], np.full(count, 7)], axis=-1)


@pytest.mark.parametrize("bits", [8, 16])
def test_every_level_survives_the_round_trip(tmp_path, bits):
    levels = every_level(bits).reshape(16, -1, 3).astype(np.uint8 if bits == 8 else np.uint16)
    write_rgb(tmp_path / "a.png", from_integers(levels), bits)
    image = read_rgb(tmp_path / "a.png")
    assert image.dtype == np.float32
    assert np.array_equal(to_integers(image, bits), levels)


@pytest.mark.parametrize("bits", [8, 16])
def test_values_are_rounded_without_bias(tmp_path, bits):
    image = np.random.default_rng(0).random((64, 64, 3))
    write_rgb(tmp_path / "a.png", image, bits)
    error = (read_rgb(tmp_path / "a.png") - image) * (2**bits - 1)
    assert np.abs(error).max() <= 0.5 + 0.01
    assert abs(error.mean()) < 0.02  # truncation would give -0.5


def test_values_outside_the_range_are_clipped():
    assert to_integers(np.full((1, 1, 3), 1.7)).max() == 255
    assert to_integers(np.full((1, 1, 3), -1e30)).min() == 0


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_becomes_neither_black_nor_white(tmp_path, value):
    image = np.full((4, 4, 3), 0.5)
    image[1, 2, 0] = value
    with stops("levels", "the image", "before it is rounded to 8 bits"):
        to_integers(image)
    with rejects(tmp_path / "a.png", "NaN"):
        write_rgb(tmp_path / "a.png", image)
    assert list(tmp_path.iterdir()) == []


def test_channels_are_red_green_blue_in_the_file(tmp_path):
    write_rgb(tmp_path / "a.png", np.broadcast_to(np.float32([1.0, 0.5, 0.0]), (4, 5, 3)))
    bgr = cv2.imread(str(tmp_path / "a.png"))
    assert bgr.shape == (4, 5, 3)
    assert bgr[0, 0].tolist() == [0, 128, 255]


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_gray_is_repeated_and_alpha_left_out(tmp_path, dtype):
    top = np.iinfo(dtype).max
    cv2.imwrite(str(tmp_path / "gray.png"), np.full((3, 4), top // 5, dtype))
    cv2.imwrite(str(tmp_path / "alpha.png"), np.full((3, 4, 4), top // 5, dtype))
    for name in ("gray.png", "alpha.png"):
        image = read_rgb(tmp_path / name)
        assert image.shape == (3, 4, 3)
        assert image == pytest.approx(0.2)


def test_the_same_image_gives_the_same_bytes(tmp_path):
    image = np.random.default_rng(1).random((9, 7, 3))
    write_rgb(tmp_path / "a.png", image)
    write_rgb(tmp_path / "b.png", image)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_nan_is_refused_and_nothing_written(tmp_path):
    image = np.zeros((4, 4, 3))
    image[1, 2, 0] = np.nan
    with rejects(tmp_path / "a.png", "NaN"):
        write_rgb(tmp_path / "a.png", image)
    assert list(tmp_path.iterdir()) == []


def test_damaged_files_are_refused_by_name(tmp_path):
    write_rgb(tmp_path / "whole.png", np.random.default_rng(0).random((40, 40, 3)))
    whole = (tmp_path / "whole.png").read_bytes()
    for name, content in {"cut": whole[:-20], "empty": b"", "text": b"no image"}.items():
        path = tmp_path / f"{name}.png"
        path.write_bytes(content)
        with rejects(path):
            read_rgb(path)
    with rejects(tmp_path / "missing.png"):
        read_rgb(tmp_path / "missing.png")
