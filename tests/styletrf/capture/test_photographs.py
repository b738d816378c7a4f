import errno
import io
import os
import zlib
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pytest
from expected_errors import rejects
from hypothesis import given, settings
from hypothesis import strategies as st
from made_photographs import encoded, png_with_exif, texture, with_exif
from PIL import Image

from styletrf.capture.photographs import list_photographs, natural_order, read_photograph
from styletrf.errors import InputError

IMAGE = texture(48, 64)
JPEG = encoded(IMAGE, ".jpg", cv2.IMWRITE_JPEG_QUALITY, 95)
PROGRESSIVE = encoded(IMAGE, ".jpg", cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
RESTARTS = encoded(IMAGE, ".jpg", cv2.IMWRITE_JPEG_RST_INTERVAL, 4)
PNG = encoded(IMAGE, ".png")


def read(tmp_path, data, name="photograph.jpg"):
    (tmp_path / name).write_bytes(data)
    return read_photograph(tmp_path / name)


def refused(tmp_path, data, name="photograph.jpg"):
    with rejects(tmp_path / name):
        read(tmp_path, data, name)


def test_natural_order_compares_digits_as_numbers_and_letters_without_case():
    names = ["img10.jpg", "img9.jpg", "IMG1.jpg", "a.jpg", "img09.jpg"]
    ordered = sorted(names, key=natural_order)
    assert ordered == ["a.jpg", "IMG1.jpg", "img09.jpg", "img9.jpg", "img10.jpg"]


def test_a_name_that_is_not_utf8_is_to_be_changed(tmp_path):
    for name in (b"a.jpg", b"b.jpg", b"caf\xe9.jpg"):
        (tmp_path / os.fsdecode(name)).touch()
    with rejects("caf\N{REPLACEMENT CHARACTER}.jpg", "UTF-8") as refused:
        list_photographs(tmp_path)
    assert str(refused.value).encode()


@settings(deadline=None)
@given(st.lists(st.text("aA0129._é²", max_size=8), unique=True))
def test_natural_order_is_total(names):
    names_reversed = names[::-1]
    assert sorted(names, key=natural_order) == sorted(names_reversed, key=natural_order)


def test_only_visible_images_are_listed(tmp_path):
    for name in ("10.jpg", "9.PNG", "b.webp", ".hidden.jpg", "Thumbs.db", "notes.txt"):
        (tmp_path / name).touch()
    (tmp_path / "folder.jpg").mkdir()
    assert [path.name for path in list_photographs(tmp_path)] == ["9.PNG", "10.jpg", "b.webp"]


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_photographs_are_refused_with_their_number(tmp_path, count):
    for index in range(count):
        (tmp_path / f"{index}.jpg").touch()
    with rejects(tmp_path, count or "no") as refused:
        list_photographs(tmp_path)
    assert "3" in refused.value.remedy


def test_photographs_to_be_converted_have_a_warning(tmp_path):
    (tmp_path / "IMG_1.NEF").touch()
    with rejects(tmp_path, ".nef"):
        list_photographs(tmp_path)


def test_a_missing_folder_is_refused(tmp_path):
    with rejects(tmp_path / "nowhere", "folder"):
        list_photographs(tmp_path / "nowhere")


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tiff", ".ppm"])
def test_lossless_files_come_back_exactly(tmp_path, suffix):
    assert np.array_equal(read(tmp_path, encoded(IMAGE, suffix), "a" + suffix), IMAGE)


@pytest.mark.parametrize("suffix", [".png", ".tiff"])
def test_sixteen_bits_are_rounded(tmp_path, suffix):
    deep = np.random.default_rng(0).integers(0, 65536, (16, 16, 3)).astype(np.uint16)
    image = read(tmp_path, encoded(deep, suffix), "a" + suffix)
    assert np.abs(image - deep / 257).max() <= 0.5


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_a_gray_photograph_is_read_as_rgb(tmp_path, suffix):
    image = read(tmp_path, encoded(IMAGE[..., 0], suffix), "a" + suffix)
    assert image.shape == IMAGE.shape
    assert (image == image[..., :1]).all()


@pytest.mark.parametrize(("dtype", "white"), [(np.uint8, 255), (np.uint16, 65535)])
def test_transparent_pixels_are_blended_with_white(tmp_path, dtype, white):
    alpha = np.array([0.0, 0.5, 1.0]).reshape(1, 3, 1)
    rgba = np.concatenate([np.full((1, 3, 3), 0.25), alpha], axis=-1) * white
    image = read(tmp_path, encoded(np.rint(rgba).astype(dtype), ".png"), "a.png")
    assert np.abs(image / 255 - (0.25 * alpha + 1 - alpha)).max() < 1.01 / 255


TURNED = {
    1: lambda a: a,
    2: np.fliplr,
    3: lambda a: np.rot90(a, 2),
    4: np.flipud,
    5: lambda a: a.swapaxes(0, 1),
    6: lambda a: np.rot90(a, -1),
    7: lambda a: np.rot90(a, 2).swapaxes(0, 1),
    8: lambda a: np.rot90(a),
}
"""What EXIF 2.3 says of where the first row and column of the stored image belong."""


@pytest.mark.parametrize("orientation", TURNED)
def test_photographs_are_turned_upright(tmp_path, orientation):
    upright = read(tmp_path, with_exif(JPEG, orientation))
    assert np.array_equal(upright, TURNED[orientation](read(tmp_path, JPEG)))


def transparent(kind, orientation):
    exif, file = Image.Exif(), io.BytesIO()
    exif[0x0112] = orientation
    rgba = np.dstack([IMAGE, np.full(IMAGE.shape[:2], 200, np.uint8)])
    Image.fromarray(rgba).save(file, kind, lossless=True, exif=exif.tobytes())
    return file.getvalue()


@pytest.mark.parametrize("kind", ["PNG", "WEBP"])
@pytest.mark.parametrize("orientation", TURNED)
def test_transparent_photographs_are_turned_upright_as_others_are(tmp_path, kind, orientation):
    upright, stored = (
        read(tmp_path, transparent(kind, one), f"a.{kind}") for one in (orientation, 1)
    )
    assert np.array_equal(upright, TURNED[orientation](stored))


@pytest.mark.parametrize("orientation", TURNED)
def test_a_transparent_png_is_turned_upright_by_exif_behind_its_pixels_too(tmp_path, orientation):
    """Pillow knows that block once the pixels are decoded, and the photograph stayed lying."""
    png = encoded(np.dstack([IMAGE, np.full(IMAGE.shape[:2], 200, np.uint8)]), ".png")
    upright = read(tmp_path, png_with_exif(png, orientation, is_behind=True), "a.png")
    assert np.array_equal(upright, TURNED[orientation](read(tmp_path, png, "a.png")))


@pytest.mark.parametrize("data", [JPEG, PROGRESSIVE, RESTARTS])
def test_bytes_after_the_end_of_a_jpeg_do_no_harm(tmp_path, data):
    assert np.array_equal(read(tmp_path, data + JPEG[:500] + bytes(999)), read(tmp_path, data))


@pytest.mark.parametrize(
    "data", [JPEG, PROGRESSIVE, RESTARTS, PNG], ids=["base", "prog", "rst", "png"]
)
@pytest.mark.parametrize("kept", [0.2, 0.5, 0.95])
def test_truncated_files_are_refused(tmp_path, data, kept):
    refused(tmp_path, data[: int(kept * len(data))])


@pytest.mark.parametrize("data", [JPEG, PROGRESSIVE, RESTARTS])
@pytest.mark.parametrize(
    "damage",
    [
        pytest.param(lambda d: d[: len(d) // 2] + b"\xff\xd9", id="end set too early"),
        pytest.param(lambda d: d[:-900] + bytes(900), id="tail of zeros"),
        pytest.param(lambda d: d[: len(d) // 2] + b"abc" * 999, id="foreign tail"),
    ],
)
def test_damaged_jpegs_are_refused(tmp_path, data, damage):
    """OpenCV decodes the first kind without a word and fills with gray."""
    refused(tmp_path, damage(data))


@pytest.mark.parametrize("position", ["checksum", "data"])
def test_damaged_pngs_are_refused(tmp_path, position):
    start = PNG.index(b"IDAT") + 4
    length = int.from_bytes(PNG[start - 8 : start - 4], "big")
    assert zlib.crc32(PNG[start - 4 : start + length]) == int.from_bytes(
        PNG[start + length : start + length + 4], "big"
    )
    data = bytearray(PNG)
    data[start + (length if position == "checksum" else length // 2)] ^= 1
    refused(tmp_path, bytes(data), "a.png")


@pytest.mark.parametrize("data", [b"", b"Dear diary", b"\xff\xd8\xff"])
def test_files_that_are_no_images_are_refused(tmp_path, data):
    refused(tmp_path, data)


def test_a_missing_file_is_refused(tmp_path):
    with rejects(tmp_path / "none.jpg", os.strerror(errno.ENOENT)):
        read_photograph(tmp_path / "none.jpg")


def test_nan_in_one_pixel_is_refused_by_the_name_of_its_file(tmp_path):
    """A format that can hold NaN holds floats."""
    pixels = np.full((4, 4, 3), 0.5, np.float32)
    pixels[1, 2, 0] = np.nan
    path = tmp_path / "spoilt.tiff"
    path.write_bytes(cv2.imencode(".tiff", pixels)[1].tobytes())
    with rejects(path, "float32"):
        read_photograph(path)


def test_float_pixels_are_refused(tmp_path):
    data = cv2.imencode(".tiff", np.ones((4, 4, 3), np.float32))[1].tobytes()
    refused(tmp_path, data, "a.tiff")


def test_the_thumbnails_end_is_not_the_photographs(tmp_path):
    thumbnail = encoded(IMAGE[:8, :8])
    comment = b"\xff\xfe" + (len(thumbnail) + 2).to_bytes(2) + thumbnail
    whole = JPEG[:2] + comment + JPEG[2:]
    assert np.array_equal(read(tmp_path, whole), read(tmp_path, JPEG))
    refused(tmp_path, whole[:-2])


def test_what_others_write_to_standard_error_meanwhile_is_not_lost(tmp_path, capfd, monkeypatch):
    """Messages of other threads vanished with those of libjpeg."""
    decode = cv2.imdecode

    def decode_beside_others(*arguments):
        os.write(2, b"worker: done\n")
        pixels = decode(*arguments)
        os.write(2, b"Corrupt JPEG data: bad ICC marker\nlast words")
        return pixels

    monkeypatch.setattr(cv2, "imdecode", decode_beside_others)
    read(tmp_path, JPEG)
    assert capfd.readouterr().err == "worker: done\nlast words"


def test_what_decoders_say_of_damage_is_said_once_by_the_error(tmp_path, capfd):
    for name, data in (("a.jpg", JPEG), ("a.png", PNG), ("a.tif", encoded(IMAGE, ".tif"))):
        refused(tmp_path, data[: len(data) // 2], name)
        spoiled = data[: len(data) // 2] + bytes(40) + data[len(data) // 2 + 40 :]
        (tmp_path / name).write_bytes(spoiled)
        with suppress(InputError):
            read_photograph(tmp_path / name)
    assert capfd.readouterr().err == ""


def test_standard_error_is_given_back(tmp_path, capfd):
    refused(tmp_path, JPEG[: len(JPEG) // 2] + b"\xff\xd9")
    os.write(2, b"still here")
    assert capfd.readouterr().err == "still here"


PHONE = Path(__file__).parents[1] / "photographs" / "phone.heic"
"""64 x 48 pixels, red in the upper left quarter, turned by EXIF to stand (orientation 6)."""


def avif(pixels, orientation=1):
    exif = Image.Exif()
    exif[0x0112] = orientation
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "AVIF", exif=exif.tobytes())
    return file.getvalue()


def test_a_telephones_photograph_stands_upright():
    upright = read_photograph(PHONE)
    assert upright.shape == (64, 48, 3)
    upper_right = upright[2:30, 26:46].astype(int)
    assert np.abs(upper_right - (255, 0, 0)).max() < 12


def test_an_avif_photograph_stands_upright(tmp_path):
    pixels = texture(48, 64)
    (tmp_path / "a.avif").write_bytes(avif(pixels, orientation=6))
    upright = read_photograph(tmp_path / "a.avif")
    assert upright.shape == (64, 48, 3)
    assert np.abs(upright.astype(int) - np.rot90(pixels, -1)).mean() < 8


@pytest.mark.parametrize("encoded_file", [PHONE.read_bytes(), avif(texture(48, 64))])
@pytest.mark.parametrize("fraction", [0.0, 0.3, 0.95])
def test_a_damaged_file_of_a_telephone_is_refused(tmp_path, encoded_file, fraction):
    (tmp_path / "a.heic").write_bytes(encoded_file[: int(fraction * len(encoded_file))])
    with rejects(tmp_path / "a.heic"):
        read_photograph(tmp_path / "a.heic")
