import numpy as np
import OpenEXR
import pytest
from expected_errors import rejects
from message_words import mentions

from styletrf.files.float_images import read_float_image, write_float_image

HEIGHT, WIDTH = 11, 17


def view(seed=0):
    random = np.random.default_rng(seed)
    color = random.normal(0.5, 1.0, (HEIGHT, WIDTH, 3)).astype(np.float32)
    opacity = random.random((HEIGHT, WIDTH), dtype=np.float32)
    depth = random.random((HEIGHT, WIDTH), dtype=np.float32) * 1e6
    depth[0, :3] = np.inf
    return color, opacity, depth


def test_float_returns_bit_for_bit(tmp_path):
    color, opacity, depth = view()
    write_float_image(tmp_path / "a.exr", color, opacity, depth, half=False)
    image = read_float_image(tmp_path / "a.exr")
    assert np.array_equal(image.color, color)
    assert np.array_equal(image.opacity, opacity)
    assert np.array_equal(image.depth, depth)


def test_half_rounds_color_and_opacity_and_leaves_depth_exact(tmp_path):
    color, opacity, depth = view()
    write_float_image(tmp_path / "a.exr", color, opacity, depth, half=True)
    image = read_float_image(tmp_path / "a.exr")
    assert np.array_equal(image.color, color.astype(np.float16).astype(np.float32))
    assert np.array_equal(image.opacity, opacity.astype(np.float16).astype(np.float32))
    assert np.array_equal(image.depth, depth)
    assert image.color == pytest.approx(color, rel=2**-11, abs=2**-24)


@pytest.mark.parametrize("half", [True, False])
def test_other_programs_see_the_usual_channels(tmp_path, half):
    write_float_image(tmp_path / "a.exr", *view(), half=half)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        kinds = {name: channel.pixels.dtype for name, channel in file.channels().items()}
        header = dict(file.header())
    other = np.dtype(np.float16 if half else np.float32)
    assert kinds == {**dict.fromkeys("RGBA", other), "Z": np.dtype(np.float32)}
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert "capDate" not in header
    assert mentions(header["comments"], "sRGB", "background", "A", "Z")  # not as EXR has them


def test_the_same_view_gives_the_same_bytes_and_another_view_others(tmp_path):
    for name, seed in {"a": 0, "b": 0, "c": 1}.items():
        write_float_image(tmp_path / f"{name}.exr", *view(seed))
    a, b, c = ((tmp_path / f"{name}.exr").read_bytes() for name in "abc")
    assert a == b
    assert a != c


@pytest.mark.extremes("Float images")
@pytest.mark.parametrize("part", [0, 1, 2])
def test_nan_is_refused_and_nothing_written(tmp_path, part):
    parts = view()
    parts[part][3, 4] = np.nan
    with rejects(tmp_path / "a.exr", "RAZ"[part], "NaN"):
        write_float_image(tmp_path / "a.exr", *parts)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.extremes("Float images")
def test_color_beyond_half_is_refused_in_half_and_kept_in_float(tmp_path):
    color, opacity, depth = view()
    color[2, 2, 1] = 7e4
    with rejects(tmp_path / "a.exr", "G", "float16"):
        write_float_image(tmp_path / "a.exr", color, opacity, depth, half=True)
    write_float_image(tmp_path / "a.exr", color, opacity, depth, half=False)
    assert read_float_image(tmp_path / "a.exr").color.max() == np.float32(7e4)


def test_a_damaged_file_is_refused(tmp_path):
    random = np.random.default_rng(0).random((90, 90, 3), dtype=np.float32)
    write_float_image(tmp_path / "whole.exr", random, random[..., 0], random[..., 1])
    whole = (tmp_path / "whole.exr").read_bytes()
    for name, content in {"cut": whole[:2000], "text": b"nothing", "empty": b""}.items():
        (tmp_path / f"{name}.exr").write_bytes(content)
        with rejects(tmp_path / f"{name}.exr", "OpenEXR"):
            read_float_image(tmp_path / f"{name}.exr")


def test_a_missing_channel_is_named(tmp_path):
    pixels = np.zeros((4, 4), dtype=np.float32)
    OpenEXR.File({}, dict.fromkeys("RGB", pixels)).write(str(tmp_path / "a.exr"))
    with rejects(tmp_path / "a.exr", "A Z"):
        read_float_image(tmp_path / "a.exr")


def test_a_depth_of_minus_infinity_is_refused(tmp_path):
    color, opacity, depth = view()
    depth[3, 4] = -np.inf
    with rejects(tmp_path / "a.exr", "Z", "-infinity"):
        write_float_image(tmp_path / "a.exr", color, opacity, depth)
    assert list(tmp_path.iterdir()) == []
