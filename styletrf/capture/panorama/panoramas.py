"""Finds the photographs that are equirectangular panoramas, by their metadata or their pixels.

A panorama is twice as wide as high. Its metadata say that it is one (Google's Photo Sphere XMP), or
its picture shows it: the left and the right edge continue each other, and the top and the bottom
row, each a pole, have hardly more than one color. How far a picture is from that is its `mismatch`,
the largest of four ratios:

    difference of the two edges / difference of any two columns, / variation along the edges,
    variation along the top row, along the bottom row / variation along any row

Of 1,023 crops 2:1 of photographs the least mismatch is 0.51, the next 0.83; of panoramas of the
courtyard, 2048 pixels wide, it is 0.03 to 0.11, and 0.27 where a near edge runs through the seam or
a joint of the pavement through a pole. Photographs of one size, which one camera took, are decided
together, so that one of them does not count.
"""

import re
from collections.abc import Mapping, Sequence, Set
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import UInt8

from styletrf.capture.photographs import read_photograph
from styletrf.errors import InputError

Image = UInt8[np.ndarray, "height width 3"]
Choice = Literal["auto", "yes", "no"]

_ASPECT, _TOLERANCE = 2.0, 0.01
_MOST_MISMATCH = 0.4
_LEAST_LEVELS = 4.0  # of 255, by which a picture has to vary to show anything
_ROWS, _COLUMNS = 512, 64  # of a picture that are looked at

_EQUIRECTANGULAR = re.compile(rb"GPano:ProjectionType\W{1,4}equirectangular")
_SIDE = rb"GPano:%b%bPixels\W{1,4}(\d+)"
_SETTING = """--SceneCapture-settings '{"panoramas": "no"}'"""


def find_panoramas(sizes: Mapping[Path, tuple[int, int]], choice: Choice) -> set[Path]:
    """Returns the photographs that are panoramas, all of them where the choice is yes.

    Args:
        sizes: Width and height of the upright photographs, by their files.
        choice: `auto` decides from the photographs. Parts of panoramas are none.

    Raises:
        InputError: A panorama does not show all directions.
    """
    if choice == "no":
        return set()
    if choice == "yes":
        for file, size in sizes.items():
            require_all_directions(file.name, *size)
        return set(sizes)
    data_of = ((file, file.read_bytes()) for file in sizes)
    declared = {file for file, data in data_of if _declares_panorama(data) and _fraction(data) == 1}
    for file in declared:
        require_all_directions(file.name, *sizes[file])
    found = set(declared)
    for size in set(sizes.values()):
        files = [file for file in sizes if sizes[file] == size]
        if has_panorama_shape(*size) and show_panoramas(_mismatches(files, declared)):
            found |= set(files)
    return found


def show_panoramas(mismatches: Sequence[float]) -> bool:
    """Returns whether at least half of the pictures of one camera are panoramas."""
    return 2 * sum(mismatch < _MOST_MISMATCH for mismatch in mismatches) >= len(mismatches)


def _mismatches(files: Sequence[Path], declared: Set[Path]) -> list[float]:
    """Returns the mismatches of photographs; 0 for those that are declared to be panoramas."""
    return [0.0 if file in declared else panorama_mismatch(read_photograph(file)) for file in files]


def has_panorama_shape(width: int, height: int) -> bool:
    """Returns whether a picture is twice as wide as high, within 1 %."""
    return abs(width / height / _ASPECT - 1) <= _TOLERANCE


def panorama_mismatch(image: Image) -> float:
    """Returns how far a picture is from a panorama; infinite where it has no such shape.

    It is infinite, too, where a denominator of the ratios is below 4 levels: that proves nothing.
    """
    if not has_panorama_shape(image.shape[1], image.shape[0]):
        return float("inf")
    rows = image[:: max(1, image.shape[0] // _ROWS)].astype(np.float32)
    sampled = rows[:, :: max(1, image.shape[1] // _COLUMNS)]
    apart = np.abs(sampled[:, :, None] - sampled[:, None]).mean(axis=(0, 3))
    edges = rows[:, [0, -1]].std(axis=0).mean(axis=-1)
    along = rows.std(axis=1).mean(axis=-1)
    poles = image[[0, -1]].astype(np.float32).std(axis=1).mean(axis=-1)
    usual = np.array([np.median(apart), edges.min(), np.median(along), np.median(along)])
    if usual.min() < _LEAST_LEVELS:
        return float("inf")
    seam = np.abs(rows[:, 0] - rows[:, -1]).mean()
    return float((np.array([seam, seam, *poles]) / usual).max())


def fraction_of_directions(file: Path) -> float:
    """Returns the fraction of all directions that a panorama shows, by its XMP; 1 without one.

    A telephone's sweep shows a part: it is neither a pinhole's picture nor a whole panorama.
    """
    data = file.read_bytes()
    return _fraction(data) if _declares_panorama(data) else 1.0


def _declares_panorama(data: bytes) -> bool:
    """Returns whether the XMP of a photograph, which is plain text in any format, says so."""
    return bool(_EQUIRECTANGULAR.search(data))


def _fraction(data: bytes) -> float:
    """Returns the fraction of the width times that of the height, as the XMP of a panorama says."""
    fraction = 1.0
    for side in (b"Width", b"Height"):
        found = [
            re.search(_SIDE % (part, side), data) for part in (b"CroppedAreaImage", b"FullPano")
        ]
        cropped, full = (int(one.group(1)) if one else 0 for one in found)
        fraction *= cropped / full if 0 < cropped < full else 1.0
    return fraction


def require_all_directions(name: str, width: int, height: int) -> None:
    """Refuses a picture that does not have the shape of a panorama.

    Raises:
        InputError: It is not twice as wide as high.
    """
    if not has_panorama_shape(width, height):
        problem = f"is {width}x{height}, and a panorama of all directions is twice as wide as high"
        raise InputError(name, problem, _remedy())


def _remedy() -> str:
    return f"Leave it out, or have it taken as a photograph with {_SETTING}"
