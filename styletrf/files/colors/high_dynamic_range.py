"""HDR video (ITU-R BT.2100) as pictures of usual range, in sRGB.

The signal of PQ is the light of a display (BT.2100-2, table 4), and that of HLG the light of the
scene (table 5). From this a display makes its own: times the scene's luminance to the power 0.2, if
it shows 1000 cd/m2. Diffuse white is 203 cd/m2 by ITU-R BT.2408: 75 % of the signal of HLG, 58 % of
that of PQ. It becomes the white of sRGB (IEC 61966-2-1), and so does everything brighter.
"""

from collections.abc import Mapping
from types import MappingProxyType

import cv2
import numpy as np
from av.video.reformatter import ColorTrc
from jaxtyping import Float, UInt8, UInt16

PQ, HLG = int(ColorTrc.SMPTE2084), int(ColorTrc.ARIB_STD_B67)

_WHITE_CD_M2, _BRIGHTEST_CD_M2 = 203.0, 10000.0
_HLG_WHITE = 0.75
_HLG_POWER = 0.2
_LUMINANCE = np.array([[0.2627, 0.6780, 0.0593]])  # of BT.2020's primaries
_BT709_FROM_BT2020 = np.array(
    [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]]
)  # ITU-R BT.2407, 2
_ROWS = 64  # of a frame at a time, which stay in a processor's cache
_DROPPED_BITS = 4  # of 16: video has 10 or 12
_STEPS = (1 << 14) - 1  # of linear light, so that dark ones are less than a level of sRGB apart


def srgb_from_hdr(
    signal: UInt16[np.ndarray, "height width 3"], curve: int
) -> UInt8[np.ndarray, "height width 3"]:
    """Returns sRGB of 8 bits from the signal of an HDR video, clipped at diffuse white.

    Args:
        signal: RGB of BT.2020's primaries, from 0 to 65535.
        curve: `PQ` or `HLG`.
    """
    rows = range(0, len(signal), _ROWS)
    return np.concatenate([_converted(signal[row : row + _ROWS], curve) for row in rows])


def _converted(
    signal: UInt16[np.ndarray, "rows width 3"], curve: int
) -> UInt8[np.ndarray, "rows width 3"]:
    light = _LIGHT[curve][signal >> _DROPPED_BITS]
    if curve == HLG:
        light *= cv2.pow(cv2.transform(light, _LUMINANCE), _HLG_POWER).reshape(*light.shape[:2], 1)
    linear = np.asarray(cv2.transform(light, _STEPS * _BT709_FROM_BT2020))
    np.clip(linear, 0, _STEPS, out=linear)
    return _ENCODED[linear.astype(np.uint16)]


def _pq_light(signal: Float[np.ndarray, " levels"]) -> Float[np.ndarray, " levels"]:
    """Returns the light of a display, in units of diffuse white."""
    m1, m2 = 2610 / 16384, 2523 / 32
    c1, c2, c3 = 3424 / 4096, 2413 / 128, 2392 / 128
    root = signal ** (1 / m2)
    relative = (np.maximum(root - c1, 0) / (c2 - c3 * root)) ** (1 / m1)
    return np.asarray(relative * _BRIGHTEST_CD_M2 / _WHITE_CD_M2)


def _hlg_light(signal: Float[np.ndarray, " levels"]) -> Float[np.ndarray, " levels"]:
    """Returns the light of the scene, in units of diffuse white."""

    def scene(value: np.ndarray) -> np.ndarray:
        a = 0.17883277
        b, c = 1 - 4 * a, 0.5 - a * np.log(4 * a)
        return np.where(value <= 0.5, value**2 / 3, (np.exp((value - c) / a) + b) / 12)

    return np.asarray(scene(signal) / scene(np.array(_HLG_WHITE)))


def _srgb_levels() -> UInt8[np.ndarray, " steps"]:
    linear = np.linspace(0, 1, _STEPS + 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(255 * encoded), dtype=np.uint8)


_SIGNAL = np.linspace(0, 1, 1 << (16 - _DROPPED_BITS))
_LIGHT: Mapping[int, Float[np.ndarray, " levels"]] = MappingProxyType(
    {PQ: _pq_light(_SIGNAL).astype(np.float32), HLG: _hlg_light(_SIGNAL).astype(np.float32)}
)
_ENCODED = _srgb_levels()
