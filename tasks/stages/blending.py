"""Validation of `--strength`, `--blend` and `--region`, which blend styles in the frames."""

import functools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from styletrf.errors import InputError
from tasks.stages.style_parameters import FrameParameters

_LEAST_REST = 1e-6
"""The least weight of the main style: rounding of the others' sum cannot make it negative."""


def validate_blend(stage: FrameParameters) -> None:
    """Validates --strength, --blend and --region; blending requires fields that share one density.

    Raises:
        InputError: A weight or region is invalid, or the density is not shared.
    """
    weights = list(stage.blend.values())
    if not 0 <= stage.strength <= 1:
        subject = f"--strength {stage.strength}"
        raise InputError(subject, "is not between 0 and 1", "Give a number from 0 to 1")
    most = 1 - _LEAST_REST
    if not all(isinstance(w, float | int) and w > 0 for w in weights) or sum(weights) > most:
        subject = f"--blend {dict(stage.blend)}"
        problem = "has invalid weights: each has to be above 0, and their sum below 1"
        raise InputError(subject, problem, 'Give such as {"udnie": 0.3}')
    _validate_region(stage.region)
    _validate_per_frame(stage)
    blended = stage.blend or stage.region or (stage.strength < 1 and stage.strategy != "s3")
    if blended and (stage.method == "per-frame" or stage.strategy != "s3"):
        subject = f"--method {stage.method} --strategy {stage.strategy}"
        problem = "has no density that several styles share"
        raise InputError(subject, problem, "Leave out --strength, --blend and --region")


def _validate_per_frame(stage: FrameParameters) -> None:
    """Rejects parameters of priors and fields if every frame is stylized independently."""
    if stage.method != "per-frame":
        return
    for name in ("colors", "strategy", "match", "rounds", "stylizer"):
        if not stage.is_default(name):
            subject = f"--method per-frame --{name} {getattr(stage, name)}"
            raise InputError(subject, "stylizes frames without a field", f"Leave out --{name}")


def _validate_region(region: Mapping[str, Any]) -> None:
    if region and not _is_box(region) and not _is_masked_view(region):
        raise InputError(
            f"--region {dict(region)}",
            "is not a region",
            'Give {"box": [[x, y, z], [x, y, z]]} (least and greatest corner)'
            ' or {"view": "0003", "mask": "FILE.png"}',
        )
    if "mask" in region:
        _validate_mask(region["mask"])


def _validate_mask(mask: Any) -> None:
    if not (isinstance(mask, str) and Path(mask).is_file()):
        subject = f"--region, mask {mask}"
        raise InputError(subject, "does not exist", "Give an image that is white where styled")
    _read_mask(mask, Path(mask).stat().st_mtime_ns)


@functools.cache
def _read_mask(mask: str, _changed_ns: int) -> None:
    """Reads the whole mask, once for all stages of a command."""
    from styletrf.capture.photographs import read_photograph

    read_photograph(Path(mask))


def _is_masked_view(region: Mapping[str, Any]) -> bool:
    return set(region) == {"view", "mask"} and isinstance(region["view"], str)


def _is_box(region: Mapping[str, Any]) -> bool:
    corners = region.get("box")
    if set(region) != {"box"} or not isinstance(corners, list | tuple) or len(corners) != 2:
        return False
    are_points = all(
        isinstance(c, list | tuple) and len(c) == 3 and all(_is_finite(v) for v in c)
        for c in corners
    )
    return are_points and all(a < b for a, b in zip(*corners, strict=True))


def _is_finite(value: Any) -> bool:
    return isinstance(value, int | float) and abs(value) < math.inf
