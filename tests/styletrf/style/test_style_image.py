import base64
import tracemalloc
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from expected_errors import rejects
from huge_pictures import huge_png
from message_words import mentions

from styletrf.errors import InputError
from styletrf.style.style_image import read_style_image

CMYK = zlib.decompress(
    base64.b85decode(
        b"c-s4a<NrGbKF5^&q*R6!1`zmvo57iZmy?T|i-VV&i<^&+mtR;xR9HwzSY1X=TtQFM&_GX9SI5}O%g)%$&0I&<A>7f;"
        b"$1f;2$jB}#F)ARzD=^6a{{aRO4h9DX2Nq{R246vjNI?c~L5BZF7~~lk7+D#?fB^~^nV4Bv+1NRNRst1l6<}auWM*b!"
        b"VP<7zVFAk40_7Q41X+a?4ISBp0~6Vm3Pp?>CobercG`GQH0a_772~9$CQdFfaS2H&RW)@DO)V2sGjj_|D`yv1H+K(D"
        b"ui%i-u<(e;sN|H?wDgS3tm2Z=vhs?`s^*r~w)T$Bu1S-pOr17;#>`oZ7B5-4Z25|nt2S-kvUS_`9Xod&I(+2lvEwIB"
        b"p1O4T%GGPvZ`{1~@X_NZPoF)1@$%KjPoKYh{r3IG&tLy<G4QcCGx#z@GI%pE*fV^2^_lB4*Oylsi@G4_XV<>DFg6hV"
        b"D%+QY#HFIF_A{+tWhjd0qAE^WL=)NnHvy9W@Xi"
    )
)  # a JPEG of 64x64 pixels, four channels: red, green over blue, white
_ORIENTED = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"  # turn right


def painting(height: int = 80, width: int = 100) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, (height, width, 3), dtype=np.uint8)


def write(path: Path, bgr: np.ndarray) -> Path:
    cv2.imwrite(str(path), bgr)
    return path


def test_values_are_rgb_in_0_to_1(tmp_path: Path):
    bgr = painting()
    image = read_style_image(write(tmp_path / "a.png", bgr))
    assert image.dtype == np.float32
    np.testing.assert_allclose(image, bgr[..., ::-1] / 255, atol=1e-6)


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_16_bits_are_rounded_to_8(tmp_path: Path, suffix: str):
    bgr = np.random.default_rng(0).integers(0, 65536, (64, 64, 3), dtype=np.uint16)
    image = read_style_image(write(tmp_path / f"a{suffix}", bgr))
    np.testing.assert_allclose(image, bgr[..., ::-1] / 65535, atol=0.51 / 255)


def test_gray_becomes_three_equal_channels(tmp_path: Path):
    gray = painting()[..., 0]
    image = read_style_image(write(tmp_path / "a.png", gray))
    for channel in range(3):
        np.testing.assert_allclose(image[..., channel], gray / 255, atol=1e-6)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_transparent_parts_are_white(tmp_path: Path, dtype: type):
    top = np.iinfo(dtype).max
    bgra = np.dstack([painting().astype(dtype), np.full((80, 100), top, dtype)])
    bgra[:40, :, 3] = 0
    image = read_style_image(write(tmp_path / "a.png", bgra))
    np.testing.assert_allclose(image[:40], 1)
    np.testing.assert_allclose(image[40:], bgra[40:, :, 2::-1] / top, atol=0.51 / 255)


def test_a_jpeg_of_cmyk_becomes_rgb(tmp_path: Path):
    (tmp_path / "a.jpg").write_bytes(CMYK)
    image = read_style_image(tmp_path / "a.jpg")
    corners = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 1]]], np.float32)
    np.testing.assert_allclose(image[10::44, 10::44][:2, :2], corners, atol=0.02)


@pytest.mark.parametrize(("height", "width"), [(64, 8000), (2000, 70), (80, 641)])
def test_of_a_very_long_painting_the_middle_is_used(
    tmp_path: Path, height: int, width: int, caplog: pytest.LogCaptureFixture
):
    bgr = painting(height, width)
    image = read_style_image(write(tmp_path / "a.png", bgr))
    longest = 8 * min(height, width)
    assert max(image.shape) == longest
    top, left = max(0, height - longest) // 2, max(0, width - longest) // 2
    part = bgr[top : top + longest, left : left + longest, ::-1]
    np.testing.assert_allclose(image, part / 255, atol=1e-6)
    assert mentions(caplog.text, "a.png", longest)


def test_a_painting_of_eight_to_one_is_used_whole(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    bgr = painting(300, 2400)
    assert read_style_image(write(tmp_path / "a.png", bgr)).shape == bgr.shape
    assert not caplog.records


@pytest.fixture
def most_px(monkeypatch: pytest.MonkeyPatch) -> int:
    """The longest that a shorter side may be, which here makes small files large."""
    monkeypatch.setattr("styletrf.style.style_image.LARGEST_SQUARE_PX", 128)
    return 128


@pytest.mark.parametrize(("height", "width"), [(129, 140), (256, 262), (600, 500), (200, 1600)])
def test_a_large_scan_is_reduced_to_the_most_pixels_a_side_and_shows_all_of_it(
    tmp_path: Path, most_px: int, height: int, width: int
):
    ramp = np.add.outer(np.linspace(0, 127, height), np.linspace(0, 128, width))
    bgr = np.dstack([ramp, ramp[::-1], 255 - ramp]).astype(np.uint8)
    image = read_style_image(write(tmp_path / "a.png", bgr))
    assert min(image.shape[:2]) == most_px
    assert image.shape[0] * width == pytest.approx(image.shape[1] * height, rel=0.5 / most_px)
    rows, columns = (np.linspace(0, n - 1, 9).astype(int) for n in image.shape[:2])
    there = np.ix_((rows * height) // image.shape[0], (columns * width) // image.shape[1])
    np.testing.assert_allclose(image[np.ix_(rows, columns)], bgr[there][..., ::-1] / 255, atol=0.03)


@pytest.mark.parametrize(("height", "width"), [(128, 128), (127, 400), (128, 1000)])
def test_a_painting_of_the_most_pixels_a_side_keeps_each_of_them(
    tmp_path: Path, most_px: int, height: int, width: int
):
    bgr = painting(height, width)
    image = read_style_image(write(tmp_path / "a.png", bgr))
    assert (np.rint(255 * image) == bgr[..., ::-1]).all()


def test_of_a_large_scan_no_floating_point_picture_is_made(tmp_path: Path, most_px: int):
    """Its covariance alone took 54 bytes a pixel."""
    bgr = painting(8 * most_px, 8 * most_px)
    path = write(tmp_path / "a.png", bgr)
    tracemalloc.start()
    try:
        read_style_image(path)
        _, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak_bytes < 5 * bgr.size, "less than in float32, beside the file and its decoding"


def test_orientation_of_the_camera_is_followed(tmp_path: Path):
    gradient = np.tile(np.linspace(0, 255, 100, dtype=np.uint8), (80, 1))
    jpeg = cv2.imencode(".jpg", gradient)[1].tobytes()
    segment = b"\xff\xe1" + (len(_ORIENTED) + 2).to_bytes(2, "big") + _ORIENTED
    (tmp_path / "a.jpg").write_bytes(jpeg[:2] + segment + jpeg[2:])
    image = read_style_image(tmp_path / "a.jpg")
    assert image.shape == (100, 80, 3)
    assert image[0].mean() < 0.1 < 0.9 < image[-1].mean()


@pytest.mark.parametrize(
    ("content", "value"),
    [
        (None, "style"),
        (b"", "empty"),
        (b"a text, not a painting", "damaged"),
        (cv2.imencode(".jpg", painting())[1].tobytes()[:3000], "damaged"),
        (cv2.imencode(".jpg", painting(400, 400))[1].tobytes()[:-200], "damaged"),
        (cv2.imencode(".png", painting(1, 1))[1].tobytes(), "1x1"),
        (cv2.imencode(".png", painting(16, 16))[1].tobytes(), "16x16"),
        (cv2.imencode(".png", painting(63, 400))[1].tobytes(), "400x63"),
        (cv2.imencode(".png", painting(20, 8000))[1].tobytes(), "8000x20"),
        (
            cv2.imencode(".png", painting()[..., [0, 1, 2, 2]] * [1, 1, 1, 0])[1].tobytes(),
            "color",
        ),  # transparent all over
        (cv2.imencode(".png", np.full((90, 90, 3), 200, np.uint8))[1].tobytes(), "color"),
        (cv2.imencode(".png", painting() // 64 + 90)[1].tobytes(), "color"),
    ],
)
def test_what_cannot_be_a_style_is_an_input_error(
    tmp_path: Path, content: bytes | None, value: str
):
    path = tmp_path / "style.jpg"
    if content is not None:
        path.write_bytes(content)
    with rejects(path, value):
        read_style_image(path)


def test_a_painting_of_one_color_is_refused_at_any_size(tmp_path: Path):
    """Sums in float32 gave a large one a contrast."""
    bgr = np.full((1500, 1500, 3), 230, np.uint8)
    bgr[::9, ::7] = 231
    with rejects(write(tmp_path / "flat.png", bgr), "color"):
        read_style_image(tmp_path / "flat.png")


def test_a_painting_of_too_many_pixels_is_refused_with_the_bound(tmp_path: Path):
    """It was called damaged."""
    (tmp_path / "scan.png").write_bytes(huge_png())
    with rejects(tmp_path / "scan.png", "2^30"):
        read_style_image(tmp_path / "scan.png")


def test_a_folder_is_an_input_error(tmp_path: Path):
    with pytest.raises(InputError):
        read_style_image(tmp_path)
