"""The path parameters: camera path, length, frame rate and frame size; see `docs/paths.md`.

They are arguments of the main command and of all stages that depend on the path: the frames, their
metrics, and the priors, which cover the surfaces that the path sees.
"""

import functools
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import luigi

from pipeline.digest import file_digest
from pipeline.parameters import FloatParameter, IntParameter
from styletrf.configuration import configured
from styletrf.errors import InputError
from styletrf.files.frame_limits import (
    DEFAULT_RATE,
    FASTEST_RATE,
    LARGEST_PX,
    SLOWEST_RATE,
    SMALLEST_PX,
)
from styletrf.trajectory.key_frames import LONGEST_S, seconds_of_file
from styletrf.trajectory.trajectory_config import TrajectoryConfig
from tasks.stages.stage import PresetStage

NAMED_PATHS = ("auto", "orbit", "spiral", "dolly", "photographs")


class PathParameters(PresetStage):
    """The camera path, its length, and the rate and size of the frames."""

    path = luigi.Parameter(
        default="auto",
        description="auto, orbit, spiral, dolly or photographs (their own order, smoothed); or a"
        " file: key frames as JSON, Blender's transforms.json, or a COLMAP model's folder",
    )
    seconds = FloatParameter(default=0.0, description="length of the path; 0 for the quality's")
    frame_rate = IntParameter(
        default=0,
        description=f"frames a second, {SLOWEST_RATE} to {FASTEST_RATE}; 0 for {DEFAULT_RATE}",
    )
    frame_size = IntParameter(
        default=0, description="longer side of the frames in pixels, 64 to 3840; 0: the scene's"
    )

    def validate(self) -> None:
        """Rejects a path that is neither a name nor a file, and sizes and times out of range.

        Raises:
            InputError: A value is invalid; the error names the valid ones.
        """
        super().validate()
        file = self.path_file()
        if file is not None and not (file.is_file() or any(file.glob("cameras.*"))):
            remedy = f"Give {', '.join(NAMED_PATHS)}, or the path of a file (docs/paths.md)"
            raise InputError(f"--path {self.path}", "is neither a path's name nor a file", remedy)
        if not 0 <= self.seconds <= LONGEST_S:
            self._refuse("seconds", f"is not between 0 and {LONGEST_S:g} seconds", "8")
        if self.frame_rate and not SLOWEST_RATE <= self.frame_rate <= FASTEST_RATE:
            bounds = f"{SLOWEST_RATE} and {FASTEST_RATE}"
            self._refuse("frame_rate", f"is not between {bounds} frames a second", "30")
        if self.frame_size and not SMALLEST_PX <= self.frame_size <= LARGEST_PX:
            bounds = f"{SMALLEST_PX} and {LARGEST_PX} pixels"
            self._refuse("frame_size", f"is not between {bounds}", "1920")

    def path_file(self) -> Path | None:
        """Returns the file or folder that contains the path; None for a path by its name."""
        return None if self.path in NAMED_PATHS else Path(self.path)

    @property
    def path_seconds(self) -> float:
        """Returns the duration of a path whose file has times; 0 for any other path."""
        file = self.path_file()
        with suppress(OSError):
            return _seconds_of(file, file.stat().st_mtime_ns) if file else 0.0
        return 0.0  # there is no such file, which `validate` reports

    def path_settings(self) -> dict[str, Any]:
        """Returns the settings of TrajectoryFrames that these parameters replace."""
        settings = {
            "trajectory.seconds": self.seconds,
            "frames_per_second": self.frame_rate,
            "long_side_px": self.frame_size,
        }
        return {name: value for name, value in settings.items() if value}

    def path_identity(self) -> Mapping[str, object]:
        """Returns the path's name, or only "file" for a file, whose digest is a source."""
        return {} if self.path == "auto" else {"path": "file" if self.path_file() else self.path}

    def path_digests(self) -> Mapping[str, str]:
        """Returns the digests of the files that contain the path."""
        file = self.path_file()
        if file is None or not file.exists():
            return {}
        if not file.is_dir():
            return {"path": file_digest(file)}
        files = (found for found in sorted(file.iterdir()) if found.is_file())
        return {f"path/{found.name}": file_digest(found) for found in files}

    def _refuse(self, name: str, problem: str, example: str) -> None:
        argument = f"--{name.replace('_', '-')} {getattr(self, name)}"
        raise InputError(argument, problem, f"Give one such as {example}")


@functools.cache
def _seconds_of(file: Path, _changed_ns: int) -> float:
    """Returns the duration of a path in a file, read once for all stages of a command."""
    return seconds_of_file(file)


def frame_count(settings: Mapping[str, Any], path_seconds: float = 0.0) -> int | None:
    """Returns how many frames a path has.

    It is None if the settings are not valid, which the stage itself rejects.

    Args:
        settings: Those of TrajectoryFrames.
        path_seconds: The duration of a path whose file has times; 0 for any other path.
    """
    rate = settings.get("frames_per_second", DEFAULT_RATE)
    prefix = "trajectory."
    own = {
        name.removeprefix(prefix): settings[name] for name in settings if name.startswith(prefix)
    }
    with suppress(InputError, OverflowError):
        if type(rate) is int and SLOWEST_RATE <= rate <= FASTEST_RATE:
            return configured(TrajectoryConfig, own).count(rate, path_seconds)
    return None
