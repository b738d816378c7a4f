"""HDR clips as telephones write them, read as pictures of usual range."""

import av
import numpy as np
import pytest
from av.video.reformatter import ColorPrimaries, ColorRange, Colorspace

from styletrf.files.colors.high_dynamic_range import HLG, PQ, srgb_from_hdr
from styletrf.files.video_frames import first_frame

BT2020_FROM_BT709 = np.array(
    [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]]
)  # ITU-R BT.2087
KR, KB = 0.2627, 0.0593
KG = 1 - KR - KB
COLORS = [(255, 0, 0), (0, 188, 0), (20, 40, 200), (188, 188, 188), (196, 142, 118), (40, 40, 40)]


def linear(srgb):
    encoded = np.array(srgb) / 255
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def hlg_signal(light_cd_m2):
    """What a camera writes so that a display of 1000 cd/m2 shows this light."""
    relative = light_cd_m2 / 1000
    luminance = max(relative @ [KR, KG, KB], 1e-9)
    scene = relative * luminance ** (1 / 1.2 - 1)
    a, b, c = 0.17883277, 0.28466892, 0.55991073
    logarithm = a * np.log(np.maximum(12 * scene - b, 1e-9)) + c
    return np.where(scene <= 1 / 12, np.sqrt(3 * scene), logarithm)


def pq_signal(light_cd_m2):
    power = (light_cd_m2 / 10000) ** (1305 / 8192)
    return ((107 / 128 + 2413 / 128 * power) / (1 + 2392 / 128 * power)) ** (2523 / 32)


SIGNAL = {HLG: hlg_signal, PQ: pq_signal}


def write_hdr(path, signal, curve, columns=64, matrix=Colorspace.BT2020):
    """Writes a clip of one color, in 10 bits of limited range, which says that its matrix is so."""
    y = signal @ [KR, KG, KB]
    levels = (
        64 + 876 * y,
        512 + 448 * (signal[2] - y) / (1 - KB),
        512 + 448 * (signal[0] - y) / (1 - KR),
    )
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=24, options={"crf": "4"})
        stream.width, stream.height, stream.pix_fmt = columns, 48, "yuv420p10le"
        frame = av.VideoFrame(columns, 48, "yuv420p10le")
        for plane, level in zip(frame.planes, levels, strict=True):
            plane.update(np.full(plane.buffer_size // 2, round(level), np.uint16).tobytes())
        for tagged in (stream.codec_context, frame):
            tagged.colorspace, tagged.color_range = int(matrix), int(ColorRange.MPEG)
            tagged.color_trc, tagged.color_primaries = curve, int(ColorPrimaries.BT2020)
        container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


@pytest.mark.parametrize("color", COLORS)
@pytest.mark.parametrize("curve", [HLG, PQ])
def test_a_color_below_white_has_the_srgb_of_its_light(tmp_path, curve, color):
    """Its curve and primaries were ignored: red came back as gray brown."""
    light_cd_m2 = 203 * BT2020_FROM_BT709 @ linear(color)
    write_hdr(tmp_path / "a.mp4", SIGNAL[curve](light_cd_m2), curve)
    pixels = first_frame(tmp_path / "a.mp4").pixels
    assert pixels.shape == (48, 64, 3)
    light = 255 * np.abs(linear(pixels[24, 32]) - linear(color))
    assert np.minimum(light, np.abs(pixels[24, 32] - np.array(color, float))).max() <= 4


@pytest.mark.parametrize("curve", [HLG, PQ])
@pytest.mark.parametrize("columns", [64, 1280])
def test_the_pixels_of_hdr_that_names_no_matrix_are_those_of_bt2020(tmp_path, curve, columns):
    """It was read as of usual range: red came out too green, as BT.601 if small, else as BT.709."""
    found = []
    for matrix in (Colorspace.BT2020, 2):  # 2 is unspecified
        signal = SIGNAL[curve](203 * BT2020_FROM_BT709 @ linear((200, 40, 40)))
        write_hdr(tmp_path / "a.mp4", signal, curve, columns, matrix)
        found.append(first_frame(tmp_path / "a.mp4").pixels)
    assert (found[0] == found[1]).all()


@pytest.mark.parametrize("curve", [HLG, PQ])
def test_gray_stays_gray_and_what_is_brighter_than_white_is_white(curve):
    gray = np.repeat(np.linspace(0, 65535, 1000).astype(np.uint16)[None, :, None], 3, axis=2)
    found = srgb_from_hdr(gray, curve)
    assert np.ptp(found, axis=2).max() <= 1
    assert (np.diff(found[0, :, 1].astype(int)) >= 0).all()
    white = round(float(SIGNAL[curve](np.full(3, 203.0))[0]) * 65535)
    assert (srgb_from_hdr(np.full((1, 1, 3), white, np.uint16), curve) >= 254).all()
    assert (found[gray >= white + 100] == 255).all()
    assert (found[gray < 0.9 * white] < 250).all()


def test_a_frame_is_converted_alike_in_all_of_its_rows():
    signal = np.random.default_rng(0).integers(0, 65536, (1, 5, 3)).astype(np.uint16)
    found = srgb_from_hdr(np.repeat(signal, 200, axis=0), HLG)
    assert (found == found[:1]).all()
