"""Groups photographs by lens settings: a focal length and a distortion."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from styletrf.capture.capture_file import Photograph

Lenses = Literal["auto", "one", "each"]
_ONE_SETTING = 1.03  # ratio of focal lengths, up to which they are one


@dataclass(frozen=True, slots=True)
class LensSetting:
    """Photographs of one size taken with one focal length, which is known or not.

    Views of panoramas differ in their `direction`, and have no distortion. Of the `assumed` among
    the files neither EXIF, nor a clip, nor the user says that they share it with others.
    """

    files: tuple[str, ...]
    focal_prior_px: float | None
    direction: str | None = None
    assumed: tuple[str, ...] = ()


def lens_settings(
    files: Sequence[str],
    photographs: Sequence[Photograph],
    focals_px: Sequence[float | None],
    lenses: Lenses,
) -> tuple[LensSetting, ...]:
    """Returns which photographs share a lens setting, and each setting's median focal length.

    Photographs of different sizes, before they are reduced, were taken with different settings.
    With `auto` lenses, so were frames of different clips, and photographs of one size whose EXIF
    names focal lengths more than 3 % above the shortest of their group; those that name none are of
    the commonest. Views of panoramas have a setting for each size and direction, of exact focal
    length.

    Args:
        files: The files of the photographs, as COLMAP has them.
        photographs: The photographs, in the same order.
        focals_px: Their focal lengths, None where they are not known.
        lenses: See `CameraPosesConfig`.
    """
    kinds = [_kind(photograph, lenses) for photograph in photographs]
    groups = []
    for kind in sorted(set(kinds)):
        alike = [k for k, other in enumerate(kinds) if other == kind]
        is_view = photographs[alike[0]].direction is not None
        groups += [alike] if is_view else _of_one_kind(alike, focals_px, lenses)
    return tuple(
        _setting(sorted(group), files, photographs, focals_px, lenses)
        for group in sorted(groups, key=min)
    )


def _kind(photograph: Photograph, lenses: Lenses) -> tuple[str, int, int, str]:
    """Returns the key that photographs with one lens setting have in common."""
    direction, width, height = photograph.direction or "", photograph.width, photograph.height
    clip = photograph.clip if lenses == "auto" and not direction else None
    return direction, width, height, clip or ""


def _setting(
    group: Sequence[int],
    files: Sequence[str],
    photographs: Sequence[Photograph],
    focals_px: Sequence[float | None],
    lenses: Lenses,
) -> LensSetting:
    """Returns the setting that photographs share."""
    focal_px = _median([f for k in group if (f := focals_px[k]) is not None])
    first = photographs[group[0]]
    may_differ = lenses == "auto" and len(group) > 1 and first.clip is None
    assumed = tuple(files[k] for k in group if focals_px[k] is None) if may_differ else ()
    return LensSetting(tuple(files[k] for k in group), focal_px, first.direction, assumed)


def _of_one_kind(
    photographs: Sequence[int], focals_px: Sequence[float | None], lenses: Lenses
) -> list[list[int]]:
    """Returns the photographs, all of one size and clip, in groups of one focal length."""
    if lenses == "each":
        return [[k] for k in photographs]
    known = sorted((f, k) for k in photographs if (f := focals_px[k]) is not None)
    groups = [[k for _, k in run] for run in _runs(known)] if lenses == "auto" else []
    groups = groups if len(groups) > 1 else [[k for _, k in known]]
    max(groups, key=len).extend(k for k in photographs if focals_px[k] is None)
    return groups


def _runs(known: Sequence[tuple[float, int]]) -> list[list[tuple[float, int]]]:
    """Returns ascending focal lengths cut where one is more than 3 % above its run's first."""
    runs: list[list[tuple[float, int]]] = []
    for focal, k in known:
        if not runs or focal > _ONE_SETTING * runs[-1][0][0]:
            runs.append([])
        runs[-1].append((focal, k))
    return runs


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None
