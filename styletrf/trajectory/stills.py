"""Stills: the photographs' own views one after another, where no fly-through is possible.

A fly-through needs depth, which photographs from one spot or of a flat wall do not show, and
photographs of the surfaces that it sees.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from styletrf.even_spread import evenly_spread
from styletrf.geometry.cameras import Camera
from styletrf.geometry.typical_view import typical_view

MOST_STILLS = 12
_LEAST_S = 0.5  # that a still is held
_LEAST_LEFT = 0.7  # of a photograph's area, for one of another shape


@dataclass(frozen=True, slots=True)
class Still:
    """The photograph whose view is shown from a frame on, by its index."""

    first_frame: int
    photograph: str


def cuts_of(support: Mapping[str, Any]) -> list[int]:
    """Returns the frames at which another still begins, by the `support.json` of a path."""
    return [still["first_frame"] for still in support["stills"][1:]]


def stills(
    cameras: Sequence[Camera], n_frames: int, frames_per_second: float | int
) -> tuple[list[Camera], tuple[Still, ...]]:
    """Returns the cameras of the frames, and the photographs whose views they are.

    At most twelve photographs, spread evenly over all in their order, are held for equal times, no
    less than half a second, without any motion between. All have the shape of most photographs: a
    photograph of another shape is cropped, and left out where less than 70 % of it would remain.

    Args:
        cameras: The cameras of the photographs.
        n_frames: The number of frames, at least one.
        frames_per_second: The rate of the video.
    """
    typical = typical_view(cameras)
    cropped = [_cropped(camera, typical) for camera in cameras]
    alike = [camera for camera in cropped if camera is not None] or [typical]
    held = int(n_frames / (_LEAST_S * frames_per_second))
    chosen = evenly_spread(range(len(alike)), min(MOST_STILLS, max(1, held)))
    shown = [chosen[k * len(chosen) // n_frames] for k in range(n_frames)]
    firsts = [k for k in range(n_frames) if k == 0 or shown[k] != shown[k - 1]]
    frames = [replace(alike[which], name=f"{k:04d}") for k, which in enumerate(shown)]
    return frames, tuple(Still(k, alike[shown[k]].name) for k in firsts)


def _cropped(camera: Camera, typical: Camera) -> Camera | None:
    """Returns the middle of a view in the shape and size of another; None where little is left."""
    scale = max(typical.width / camera.width, typical.height / camera.height)
    left = typical.width * typical.height / (scale * scale * camera.width * camera.height)
    if left < _LEAST_LEFT:
        return None
    return replace(
        camera,
        width=typical.width, height=typical.height,
        fx=scale * camera.fx, fy=scale * camera.fy,
        cx=typical.width / 2 + scale * (camera.cx - camera.width / 2),
        cy=typical.height / 2 + scale * (camera.cy - camera.height / 2),
    )  # fmt: skip
