"""Key frames of a camera path, as the viewer or a user writes them: `docs/paths.md`.

    {"key_frames": [{"photograph": "IMG_0007"},
                    {"position": [x, y, z], "look_at": [x, y, z], "fov_deg": 60},
                    {"position": [x, y, z], "orientation": [w, x, y, z]}],
     "closed": false, "easing": 0.2}

Coordinates are those of the capture's world, which is that of `cameras.parquet`.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from styletrf.errors import InputError

WIDEST_FOV_DEG = 170.0
LONGEST_S = 600.0
"""The longest duration of a path, in seconds."""

ANIMATION_RATE = 24.0
"""The cameras a second of Blender's `transforms.json`."""

_OF_FILE = {"key_frames", "closed", "easing"}
_OF_ENTRY = {"photograph", "position", "orientation", "look_at", "fov_deg", "time_s"}
_REMEDY = "See docs/paths.md"
_LARGEST = 1e30  # Larger magnitudes, infinity and NaN are refused.

Kind = TypeVar("Kind")


@dataclass(frozen=True, slots=True)
class KeyFrame:
    """A pose of the camera: that of a photograph, or a position with a direction.

    `orientation` is a quaternion `w x y z` that turns the camera's axes (x right, y down, z ahead)
    into the world's. `fov_deg` is the angle of view along the longer side of the frame, None for
    that of the photographs; `time_s`, up to 600, counts from the beginning of the path, where the
    camera waits at the first key frame until its time; None is for even speed.
    """

    photograph: str = ""
    position_world: tuple[float, ...] | None = None
    orientation: tuple[float, ...] | None = None
    look_at_world: tuple[float, ...] | None = None
    fov_deg: float | None = None
    time_s: float | None = None


@dataclass(frozen=True, slots=True)
class KeyFrames:
    """A path by its key frames.

    `easing` is the fraction of the time during which the camera speeds up and slows down. The
    positions of `of_given_poses` are in the world of the poses that came with the photographs.
    """

    source: str
    frames: tuple[KeyFrame, ...]
    closed: bool = False
    easing: float = 0.0
    of_given_poses: bool = False

    @property
    def photographs(self) -> list[str]:
        """The names of the photographs whose places it takes."""
        return [frame.photograph for frame in self.frames if frame.photograph]

    @property
    def seconds(self) -> float:
        """The time of the last key frame; 0 without times."""
        return self.frames[-1].time_s or 0.0


def seconds_of_file(path: Path) -> float:
    """Returns the time of the last key frame in a file, in seconds.

    It is 0 if the file has no times, and if it is no path, which `path_files.read_path` reports.
    """
    try:
        values = json.loads(path.read_text())
        if "key_frames" in values:
            return key_frames_of(path, values).seconds
        return max(0.0, (len(values["frames"]) - 1) / ANIMATION_RATE)
    except (InputError, OSError, ValueError, TypeError, LookupError):
        return 0.0


def key_frames_of(path: Path, values: Mapping[str, Any]) -> KeyFrames:
    """Returns the key frames in the JSON object of a file.

    Raises:
        InputError: An entry is missing, unknown, or not of its kind; names the file and the entry.
    """
    _require_known(path, "the file", values, _OF_FILE)
    entries = _of_kind(path, "key_frames", values.get("key_frames"), list, "a list")
    if not entries:
        raise InputError(str(path), "has no key frames", _REMEDY)
    frames = tuple(_frame(path, f"key_frames[{k}]", entry) for k, entry in enumerate(entries))
    closed = _of_kind(path, "closed", values.get("closed", False), bool, "true or false")
    easing = _number(path, "easing", values.get("easing", 0.0), 0.0, 1.0)
    _require_times(path, frames, closed=closed, easing=easing or 0.0)
    return KeyFrames(str(path), frames, closed, easing or 0.0)


def write_key_frames(path: Path, keys: KeyFrames) -> None:
    """Writes key frames as `key_frames_of` reads them."""
    values = {
        "key_frames": [_entry(frame) for frame in keys.frames],
        "closed": keys.closed,
        "easing": keys.easing,
    }
    path.write_text(json.dumps(values, indent=1, allow_nan=False) + "\n")


def _entry(frame: KeyFrame) -> dict[str, Any]:
    values = {
        "photograph": frame.photograph or None,
        "position": frame.position_world,
        "orientation": frame.orientation,
        "look_at": frame.look_at_world,
        "fov_deg": frame.fov_deg,
        "time_s": frame.time_s,
    }
    return {name: value for name, value in values.items() if value is not None}


def _frame(path: Path, name: str, entry: Any) -> KeyFrame:
    values = _of_kind(path, name, entry, dict, "an object")
    _require_known(path, name, values, _OF_ENTRY)
    photograph = _of_kind(
        path, f"{name}.photograph", values.get("photograph", ""), str, "the name of a photograph"
    )
    position, orientation, look_at = (
        _vector(path, f"{name}.{word}", values.get(word), length)
        for word, length in (("position", 3), ("orientation", 4), ("look_at", 3))
    )
    directions = [d for d in (orientation, look_at) if d is not None]
    if photograph and (position or directions):
        problem = f"{name} has a photograph and a position or a direction: one of them is enough"
        raise InputError(str(path), problem, "Remove the others")
    if not photograph and (position is None or len(directions) != 1):
        problem = f"{name} is no place: it has no photograph, and not a position with one direction"
        raise InputError(
            str(path), problem, "Give photograph, or position with orientation or look_at"
        )
    if orientation is not None and math.hypot(*orientation) < 1e-6:
        raise InputError(str(path), f"{name}.orientation is zero", "Give w, x, y, z of a rotation")
    if look_at is not None and look_at == position:
        problem = f"{name}.look_at is the position itself, which is no direction"
        raise InputError(str(path), problem, "Look at another place")
    fov_deg = _number(path, f"{name}.fov_deg", values.get("fov_deg"), 1.0, WIDEST_FOV_DEG)
    time_s = _number(path, f"{name}.time_s", values.get("time_s"), 0.0, LONGEST_S)
    return KeyFrame(photograph, position, orientation, look_at, fov_deg, time_s)


def _require_times(path: Path, frames: Sequence[KeyFrame], *, closed: bool, easing: float) -> None:
    times = [frame.time_s for frame in frames if frame.time_s is not None]
    if not times:
        return
    if len(times) < len(frames):
        missing = next(k for k, frame in enumerate(frames) if frame.time_s is None)
        problem = f"key_frames[{missing}] has no time_s, but others have"
        raise InputError(str(path), problem, "Give all of them a time, or none")
    if closed:
        problem = "is closed and has times, which do not say when it returns"
        remedy = "Remove closed, and repeat the first key frame at the end with its time"
        raise InputError(str(path), problem, remedy)
    if easing:
        problem = "has easing and times, which say already how fast the camera is"
        raise InputError(str(path), problem, "Remove easing, or the times of all key frames")
    for k in range(1, len(times)):
        if times[k] <= times[k - 1]:
            problem = f"key_frames[{k}].time_s {times[k]:g} is not after the one before"
            raise InputError(str(path), problem, "Put the key frames in the order of their times")


def _require_known(path: Path, name: str, values: Mapping[str, Any], known: set[str]) -> None:
    if unknown := set(values) - known:
        problem = f"{name} has {', '.join(sorted(map(repr, unknown)))}, which means nothing there"
        raise InputError(str(path), problem, f"Known are {', '.join(sorted(known))}")


def _of_kind(path: Path, name: str, value: Any, kind: type[Kind], meaning: str) -> Kind:
    if not isinstance(value, kind):
        raise InputError(str(path), f"{name} is {json.dumps(value)}, not {meaning}", _REMEDY)
    return value


def _number(path: Path, name: str, value: Any, least: float, most: float) -> float | None:
    if value is None:
        return None
    if not _is_number(value) or not least <= value <= most:
        problem = f"{name} is {json.dumps(value)}, not a number from {least:g} to {most:g}"
        raise InputError(str(path), problem, _REMEDY)
    return float(value)


def _vector(path: Path, name: str, value: Any, length: int) -> tuple[float, ...] | None:
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != length or not all(map(_is_number, value)):
        problem = f"{name} is {json.dumps(value)}, not {length} finite numbers"
        raise InputError(str(path), problem, _REMEDY)
    return tuple(float(number) for number in value)


def _is_number(value: Any) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and abs(value) <= _LARGEST
