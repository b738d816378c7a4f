"""Splats in the files that 3DGS writes (`.ply`) and that Niantic's spz reads (`.spz`).

Both store an opacity before its sigmoid, the logarithms of scales, and a color as the constant
spherical harmonic. A `.ply` has the axes of COLMAP's world (x right, y down, z ahead, where a
camera is held upright), a `.spz` x right, y up, z back: half a turn about x lies between.
"""

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from styletrf.errors import InputError
from styletrf.exports.splats import Splats, moved_splats

CONSTANT_HARMONIC = 0.28209479177387814
UP_FROM_DOWN = np.diag([1.0, -1.0, -1.0, 1.0])
_LEAST_OPACITY = 1e-4
_FIXED_POINT_BITS = 23  # beside the sign
_FARTHEST_IN_SPZ = 2.0 ** (_FIXED_POINT_BITS - 1)
_ROOM = 2.0  # times as far a splat may be once it is fitted
_MOST_LEFT_OUT = 1e-3  # of the splats


def write_splat_ply(path: Path, splats: Splats, colors: Float[np.ndarray, "splats 3"]) -> None:
    """Writes a `.ply` as 3DGS does, without harmonics that depend on the view."""
    import_module("gsply").plywrite(path, _stored(splats, colors))


def write_spz(path: Path, splats: Splats, colors: Float[np.ndarray, "splats 3"]) -> None:
    """Writes a `.spz` of version 3.

    Positions have 24 bits, of which as many stand behind the point as the farthest allows; scales
    are rounded to 1/16 of a natural logarithm, and lie between e^-10 and e^5.9.

    Raises:
        InputError: A splat is too far from the origin.
    """
    turned = moved_splats(splats, UP_FROM_DOWN)
    farthest = max(float(np.abs(turned.centers).max()) * 1.01, 1e-6)
    if farthest > _FARTHEST_IN_SPZ:
        raise _beyond_range(farthest)
    behind_point = int(np.clip(_FIXED_POINT_BITS - np.ceil(np.log2(farthest)), 1, 24))
    data = _stored(turned, colors)
    import_module("gsply").write_spz(path, data, version=3, fractional_bits=behind_point)


def storable_in_spz(splats: Splats) -> Bool[np.ndarray, " splats"]:
    """Returns which splats a `.spz` can store, also if they move somewhat.

    Raises:
        InputError: More than one splat in a thousand is too far from the origin.
    """
    away = np.abs(splats.centers).max(axis=1)
    near: Bool[np.ndarray, " splats"] = away * _ROOM <= _FARTHEST_IN_SPZ
    if (~near).sum() > _MOST_LEFT_OUT * len(splats):
        raise _beyond_range(float(away.max()))
    return near


def _beyond_range(away: float) -> InputError:
    problem = f"reach {away:.3g} units of the world, beyond the range of .spz"
    return InputError("the splats", problem, "Export them with --format ply")


def read_splats(path: Path) -> tuple[Splats, Float[np.ndarray, "splats 3"]]:
    """Returns the splats of either file, in COLMAP's axes, and the colors in [0, 1]."""
    gsply, is_spz = import_module("gsply"), path.suffix == ".spz"
    data = gsply.read_spz(path) if is_spz else gsply.plyread(path)
    splats = Splats(
        np.asarray(data.means, np.float64),
        np.exp(np.asarray(data.scales, np.float64)),
        np.asarray(data.quats, np.float64),
        1 / (1 + np.exp(-np.asarray(data.opacities, np.float64).ravel())),
    )
    colors = np.clip(0.5 + CONSTANT_HARMONIC * np.asarray(data.sh0, np.float32), 0, 1)
    return moved_splats(splats, UP_FROM_DOWN) if is_spz else splats, colors


def _stored(splats: Splats, colors: Float[np.ndarray, "splats 3"]) -> Any:
    """Returns gsply's form of the splats, before anything is rounded."""
    opacities = np.clip(splats.opacities, _LEAST_OPACITY, 1 - _LEAST_OPACITY)
    values = {
        "means": splats.centers,
        "scales": np.log(splats.scales),
        "quats": splats.rotations,
        "opacities": np.log(opacities / (1 - opacities)),
        "sh0": (colors - 0.5) / CONSTANT_HARMONIC,
    }
    arrays = {name: np.ascontiguousarray(each, np.float32) for name, each in values.items()}
    return import_module("gsply").GSData.from_arrays(**arrays, format="ply")
