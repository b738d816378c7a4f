"""Images of unusual depths, and gray ones with transparency, as photographs."""

import io
import struct
import zlib

import cv2
import numpy as np
import pytest
from expected_errors import rejects
from PIL import Image

from styletrf.capture.masks import read_mask_image
from styletrf.capture.photographs import read_photograph

RAMP = np.linspace(0, 1, 32).repeat(32).reshape(32, 32)


def read(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    return read_photograph(tmp_path / name)


@pytest.mark.parametrize("white", [1, 15, 255, 1000, 4095, 65535])
@pytest.mark.parametrize("is_ascii", [False, True])
def test_white_of_a_pnm_is_the_level_that_its_header_names(tmp_path, white, is_ascii):
    """A photograph of 12 bits was nearly black."""
    levels = np.rint(RAMP * white).astype(int)
    packed = levels.astype(np.uint8 if white < 256 else ">u2").tobytes()
    body = b"".join(b"%d\n" % level for level in levels.flat) if is_ascii else packed
    header = f"P{2 if is_ascii else 5}\n# of a microscope\n32 32\n{white}\n".encode()
    gray = read(tmp_path, "a.pgm", header + body)[..., 1]
    assert np.abs(gray - 255 * levels / white).max() <= 1


def test_levels_above_the_white_of_a_pnm_are_white(tmp_path):
    color = read(tmp_path, "a.ppm", b"P6 1 1 100 " + bytes([50, 100, 200]))
    assert color.tolist() == [[[128, 255, 255]]]


def jpeg_2000(levels, bits):
    """An image of so many bits: one of 16 whose header is changed, about its middle level."""
    shifted = (levels + (1 << 15) - (1 << (bits - 1))).astype(np.uint16)
    lossless = [cv2.IMWRITE_JPEG2000_COMPRESSION_X1000, 1000]
    content = bytearray(cv2.imencode(".jp2", shifted, lossless)[1])
    segment = content.index(b"\xff\x4f\xff\x51") + 4
    for channel in range(int.from_bytes(content[segment + 36 : segment + 38])):
        content[segment + 38 + 3 * channel] = bits - 1
    content[content.index(b"ihdr") + 14] = bits - 1
    return bytes(content)


@pytest.mark.parametrize("bits", [10, 12, 16])
@pytest.mark.parametrize("channels", [1, 3])
def test_white_of_a_jpeg_2000_is_that_of_its_bits(tmp_path, bits, channels):
    levels = np.rint(RAMP * (2**bits - 1)).astype(int)
    image = np.dstack([levels] * channels).squeeze()
    pixels = read(tmp_path, "a.jp2", jpeg_2000(image, bits))
    assert np.abs(pixels - 255 * RAMP[..., None]).max() <= 1


@pytest.mark.parametrize("kind", ["TIFF", "JPEG2000", "PNG"])
def test_gray_with_transparency_is_composited_on_white(tmp_path, kind):
    gray = np.full((32, 32), 100, np.uint8)
    alpha = np.where(RAMP > 0.5, 0, np.where(RAMP > 0.25, 51, 255)).astype(np.uint8)
    file = io.BytesIO()
    Image.fromarray(np.dstack([gray, alpha]), "LA").save(file, kind)
    pixels = read(
        tmp_path, {"TIFF": "a.tif", "JPEG2000": "a.jp2", "PNG": "a.png"}[kind], file.getvalue()
    )
    expected = np.where(RAMP > 0.5, 255, np.where(RAMP > 0.25, 100 * 0.2 + 255 * 0.8, 100))
    assert np.abs(pixels - expected[..., None]).max() <= 1


def test_gray_that_is_multiplied_by_its_transparency_is_composited_on_white(tmp_path):
    """Such a TIFF lost its transparency."""
    file = io.BytesIO()
    gray, alpha = np.full((8, 8), 20, np.uint8), np.full((8, 8), 51, np.uint8)
    Image.fromarray(np.dstack([gray, alpha]), "LA").save(file, "TIFF")
    apart, multiplied = (struct.pack("<HHIH", 338, 3, 1, kind) for kind in (2, 1))
    assert apart in file.getvalue()
    pixels = read(tmp_path, "a.tif", file.getvalue().replace(apart, multiplied))
    assert np.abs(pixels - (20 + 0.8 * 255)).max() <= 1


def stroke(multiplied=False):
    """A color that fades out, as RGBA; its empty pixels keep their color."""
    alpha = np.tile(np.arange(256, dtype=np.uint8), (8, 1))
    color = np.broadcast_to(np.float64([220, 60, 40]), (8, 256, 3))
    return np.dstack([color * (alpha[..., None] / 255) if multiplied else color, alpha])


def tiff(rgba, kind):
    """A TIFF of this kind of alpha, as it comes: Pillow writes 8 bits that stand apart."""
    file = io.BytesIO()
    Image.fromarray(np.rint(rgba).astype(np.uint8)).save(file, "TIFF")
    apart, wanted = (struct.pack("<HHIH", 338, 3, 1, number) for number in (2, kind))
    assert apart in file.getvalue()
    return file.getvalue().replace(apart, wanted)


@pytest.mark.parametrize("read_on", [read_photograph, read_mask_image])
@pytest.mark.parametrize(
    "content",
    [
        pytest.param(tiff(stroke(), 2), id="apart"),
        pytest.param(tiff(stroke(multiplied=True), 1), id="multiplied"),
        pytest.param(
            cv2.imencode(".tif", np.rint(stroke()[..., [2, 1, 0, 3]]).astype(np.uint8))[
                1
            ].tobytes(),
            id="not named",
        ),
        pytest.param(
            cv2.imencode(".tif", np.rint(257 * stroke()[..., [2, 1, 0, 3]]).astype(np.uint16))[
                1
            ].tobytes(),
            id="16 bits",
        ),
    ],
)
def test_a_transparent_tiff_shows_what_the_same_png_shows(tmp_path, content, read_on):
    """Half transparent edges had dark halos."""
    file = io.BytesIO()
    Image.fromarray(stroke().astype(np.uint8)).save(file, "PNG")
    for name, data in (("a.tif", content), ("a.png", file.getvalue())):
        (tmp_path / name).write_bytes(data)
    shown, expected = (read_on(tmp_path / name).astype(int) for name in ("a.tif", "a.png"))
    assert np.abs(shown - expected).max() <= 1


def stored_tiff(channels, kind, form="plain"):
    """A TIFF of gray or RGB with alpha.

    Args:
        channels: Integers of 8 or 16 bits.
        kind: Of the alpha: 0 not named, 1 multiplied into the colors, 2 apart.
        form: plain, big-endian, 64-bit (a BigTIFF), deflated or in planes.
    """
    order, is_big = (">" if form == "big-endian" else "<"), form == "64-bit"
    planes = np.moveaxis(channels, -1, 0) if form == "in planes" else channels
    data = planes.astype(channels.dtype.newbyteorder(order)).tobytes()
    data = zlib.compress(data) if form == "deflated" else data
    height, width, count = channels.shape
    offset, word, short = (16, "Q", 4) if is_big else (8, "I", 2)
    size = len(data) // (count if form == "in planes" else 1)
    parts = [size] * (len(data) // size)
    tags = {256: [width], 257: [height], 258: [8 * channels.itemsize] * count}
    tags |= {259: [8 if form == "deflated" else 1], 262: [2 if count == 4 else 1]}
    tags |= {273: [offset + size * k for k in range(len(parts))], 277: [count], 278: [height]}
    tags |= {279: parts, 284: [2 if form == "in planes" else 1], 338: [kind]}
    directory, elsewhere, after = b"", b"", offset + len(data)
    beyond = (
        after + (8 if is_big else 2) + len(tags) * (20 if is_big else 12) + struct.calcsize(word)
    )
    for tag, values in tags.items():
        letter, number = ("I", 4) if tag in (273, 279) else ("H", 3)
        packed = struct.pack(f"{order}{len(values)}{letter}", *values)
        if len(packed) > 2 * short:
            place = struct.pack(order + word, beyond + len(elsewhere))
            elsewhere, packed = elsewhere + packed, place
        directory += struct.pack(f"{order}HH{word}", tag, number, len(values))
        directory += packed.ljust(2 * short, b"\0")
    head = struct.pack(
        f"{order}HHHQ" if is_big else f"{order}HI", *([43, 8, 0] if is_big else [42]), after
    )
    counted = struct.pack(order + ("Q" if is_big else "H"), len(tags))
    end = struct.pack(order + word, 0)
    return {"<": b"II", ">": b"MM"}[order] + head + data + counted + directory + end + elsewhere


def faded(count, kind, dtype):
    """The stroke as gray or RGB with alpha, multiplied by it if this is the kind."""
    rgba = stroke(multiplied=kind == 1) / 255
    return np.rint(rgba[..., [2, 3] if count == 2 else slice(None)] * np.iinfo(dtype).max).astype(
        dtype
    )


@pytest.mark.parametrize("form", ["plain", "big-endian", "64-bit", "deflated"])
@pytest.mark.parametrize("kind", [1, 2])
@pytest.mark.parametrize(("count", "dtype"), [(2, np.uint8), (4, np.uint8), (4, np.uint16)])
def test_a_tiff_of_any_depth_and_kind_of_alpha_shows_its_color_on_white(
    tmp_path, count, dtype, kind, form
):
    """Colors of a BigTIFF were too dark."""
    pixels = read(tmp_path, "a.tif", stored_tiff(faded(count, kind, dtype), kind, form))
    color = stroke()[..., [2, 2, 2] if count == 2 else [0, 1, 2]]
    alpha = stroke()[..., 3:] / 255
    shown_on_white = color * alpha + 255 * (1 - alpha)
    assert np.abs(pixels - shown_on_white).max() <= 1.5, "three roundings to half a level"


def test_gray_of_16_bits_with_alpha_is_refused(tmp_path):
    """It lost its transparency."""
    with rejects("a.tif", "16 bits", remedy=["PNG"]):
        read(tmp_path, "a.tif", stored_tiff(faded(2, 2, np.uint16), 2))


@pytest.mark.parametrize(("count", "dtype"), [(2, np.uint8), (2, np.uint16), (4, np.uint16)])
def test_planes_that_no_decoder_reads_are_refused(tmp_path, count, dtype):
    """OpenCV shows noise instead."""
    with rejects("a.tif", "planes", remedy=["PNG"]):
        read(tmp_path, "a.tif", stored_tiff(faded(count, 2, dtype), 2, "in planes"))


def test_planes_of_colors_of_8_bits_are_read(tmp_path):
    form = read(tmp_path, "a.tif", stored_tiff(faded(4, 2, np.uint8), 2, "in planes"))
    assert np.array_equal(form, read(tmp_path, "b.tif", stored_tiff(faded(4, 2, np.uint8), 2)))
