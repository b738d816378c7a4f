"""The files `transforms*.json` of a scene: their frames, and the photographs that these name.

Poses and lenses are read by `styletrf.capture.poses.transforms_json`.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from styletrf.capture.poses.given_poses import is_there, require_inside
from styletrf.errors import InputError

REMEDY = "Export the scene again, or move the file away: then poses are estimated"
_SUFFIXES = ("", ".png", ".jpg", ".jpeg", ".JPG", ".PNG")


def parts_of(folder: Path) -> dict[Path, bool | None]:
    """Returns the files that hold a scene's poses, and whether their photographs are held out.

    None stands for files that do not say it.
    """
    whole, train, test = (folder / f"transforms{part}.json" for part in ("", "_train", "_test"))
    if whole.exists():
        return {whole: None}
    if not train.exists():
        return {}
    return {train: False, test: True} if test.exists() else {train: None}


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame: its photograph's name, its matrix and its values; the file's values are defaults."""

    name: str
    matrix: np.ndarray
    values: dict[str, Any]
    has_own_lens: bool

    @property
    def has_size(self) -> bool:
        """Whether the file of poses gives the size of the picture that the lens is for."""
        return {"w", "h"} <= self.values.keys()


def frames_in(path: Path) -> list[Frame]:
    """Returns the frames in a file.

    Raises:
        InputError: It is not of this format.
    """
    try:
        values = json.loads(path.read_text(encoding="utf-8-sig"))
        return [
            Frame(
                str(frame["file_path"]),
                np.array(frame["transform_matrix"], dtype=np.float64),
                {**values, **frame},
                has_own_lens=bool({"fl_x", "camera_angle_x"} & frame.keys()),
            )
            for frame in values["frames"]
        ]
    except (OSError, ValueError, KeyError, TypeError, OverflowError) as error:
        raise InputError(str(path), "is no transforms file", REMEDY) from error


def photograph_named(path: Path, name: str) -> Path:
    """Returns the photograph of a `file_path`, which may lack its suffix, below the file's folder.

    Raises:
        InputError: It lies outside the folder of the file that names it.
    """
    candidates = [path.parent / f"{name}{suffix}" for suffix in _SUFFIXES]
    file = next((each for each in candidates if is_there(each)), candidates[0])
    require_inside(path, path.parent, file)
    if file.is_relative_to(path.parent):
        return file
    return path.parent / file.resolve().relative_to(path.parent.resolve())  # an absolute path


def transforms_photographs(folder: Path) -> list[Path]:
    """Returns the photographs that `read_transforms` reads, by the paths that name them.

    Raises:
        InputError: A file is not of this format, or names a photograph outside the folder.
    """
    files = [
        photograph_named(path, frame.name) for path in parts_of(folder) for frame in frames_in(path)
    ]
    return [file for file in files if is_there(file)]
