"""Frames without and with style, by name."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from styletrf.evaluation.consistency.frame_pairs import Frame, read_frame
from styletrf.even_spread import evenly_spread
from styletrf.files.float_images import FloatImage
from styletrf.geometry.camera_table import read_cameras
from styletrf.geometry.cameras import Camera
from styletrf.stylization.background import empty_background

FramePair = tuple[Any, Any]
"""The colors of a frame without and with style, in [0, 1]."""
_FRAMES_FOR_MEANS = 12  # spread along the path, of which a mean color is taken


def frames_of(inputs: Mapping[str, Path]) -> tuple[list[str], Callable[[str], FramePair]]:
    """Returns the names of the frames, and a function that reads one without and with style."""
    cameras = {c.name: c for c in read_cameras(inputs["unstylized"] / "cameras.parquet")}

    def images(name: str) -> FramePair:
        """Returns a frame without and with style."""
        frame = _read(inputs, cameras[name])
        return frame.unstylized.color, frame.stylized

    return list(cameras), images


def objects_of(
    inputs: Mapping[str, Path], *, on_one_color: bool
) -> Callable[[str], FramePair] | None:
    """Returns a function that reads a frame whose object stands on a mean color, or None.

    Measures of style look at all of a picture, and the background of an object that is cut out is
    no part of its style. It gets the object's mean color, as before a painter
    (`styletrf.stylization.background`).

    Args:
        inputs: `unstylized` and `stylized`.
        on_one_color: Whether the frame with style has the mean color of the object without it, as
            where the two are compared. Otherwise each has its own.

    Returns:
        The function, or None if frames have no background.
    """
    cameras = {c.name: c for c in read_cameras(inputs["unstylized"] / "cameras.parquet")}
    chosen = evenly_spread(list(cameras.values()), _FRAMES_FOR_MEANS)
    plain = empty_background(view for view, _ in _views(inputs, chosen))
    if plain is None:
        return None
    own = empty_background(painted for _, painted in _views(inputs, chosen))
    styled = plain if on_one_color or own is None else own

    def images(name: str) -> FramePair:
        """Returns a frame without and with style, both on mean colors."""
        ((view, painted),) = _views(inputs, [cameras[name]])
        return plain.covered(view).color, styled.covered(painted).color

    return images


def _views(
    inputs: Mapping[str, Path], cameras: Sequence[Camera]
) -> Iterator[tuple[FloatImage, FloatImage]]:
    for camera in cameras:
        frame = _read(inputs, camera)
        yield frame.unstylized, replace(frame.unstylized, color=frame.stylized)


def _read(inputs: Mapping[str, Path], camera: Camera) -> Frame:
    return read_frame(inputs["unstylized"], inputs["stylized"], camera)
