"""Frames without and with style, by name."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from styletrf.evaluation.consistency.frame_pairs import read_frame
from styletrf.geometry.camera_table import read_cameras


def frames_of(
    inputs: Mapping[str, Path],
) -> tuple[list[str], Callable[[str], tuple[Any, Any]]]:
    """Returns the names of the frames, and a function that reads one without and with style."""
    cameras = {c.name: c for c in read_cameras(inputs["unstylized"] / "cameras.parquet")}

    def images(name: str) -> tuple[Any, Any]:
        """Returns a frame without and with style."""
        frame = read_frame(inputs["unstylized"], inputs["stylized"], cameras[name])
        return frame.unstylized.color, frame.stylized

    return list(cameras), images
