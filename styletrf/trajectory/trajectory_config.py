"""The length of a camera path, and how wide and how smooth it is.

Commands check it before they begin, so this module imports no numerical library.
"""

import math
from dataclasses import dataclass

from styletrf.trajectory.key_frames import LONGEST_S, WIDEST_FOV_DEG


@dataclass(frozen=True, slots=True)
class TrajectoryConfig:
    """A path of `frames` cameras, or of `seconds`, if these are not 0, at the frame rate.

    `speed` divides the time that this takes. `turns` counts revolutions of the fly-through before a
    forward-facing scene, whole ones or it would not close; `spread` is the fraction of the
    photographs' own spread that the path uses. `easing` is the fraction of the time during which
    the camera speeds up and slows down. `fov_deg` is the angle of view along the longer side of a
    frame, 0 for the photographs'. `stabilization` smooths the path through the photographs: the
    standard deviation of a Gaussian, in photographs.
    """

    frames: int = 60
    seconds: float = 0.0
    speed: float = 1.0
    turns: float = 1.0
    spread: float = 0.7
    easing: float = 0.0
    fov_deg: float = 0.0
    stabilization: float = 1.5

    def __post_init__(self) -> None:
        if self.frames < 1:
            raise ValueError(f"a path of {self.frames} frames shows nothing")
        if self.turns < 1 or self.turns != int(self.turns):
            raise ValueError(f"a path of {self.turns} turns is not closed, as whole turns are")
        if not 0 <= self.seconds <= LONGEST_S:
            raise ValueError(f"a path takes up to {LONGEST_S:g} seconds, not {self.seconds:g}")
        if not 0 < self.speed < math.inf:
            raise ValueError(f"a speed is a positive factor such as 2, not {self.speed:g}")
        if not 0 <= self.easing <= 1:
            raise ValueError(f"easing is a fraction of the time from 0 to 1, not {self.easing:g}")
        if self.fov_deg != 0 and not 1 <= self.fov_deg <= WIDEST_FOV_DEG:
            bounds = f"from 1 to {WIDEST_FOV_DEG:g} degrees, not {self.fov_deg:g}"
            raise ValueError(f"an angle of view is 0 (the photographs') or {bounds}")
        if not 0 <= self.stabilization < math.inf:
            raise ValueError(f"a path is smoothed over photographs, not {self.stabilization:g}")

    def count(self, frames_per_second: float | int, own_seconds: float = 0.0) -> int:
        """Returns how many frames the path has.

        Args:
            frames_per_second: The rate of the video.
            own_seconds: The duration of a path whose key frames have times; 0 without. If it
                decides, the last key frame is a frame of its own, at its time.
        """
        seconds = self.seconds or own_seconds
        frames = seconds * frames_per_second if seconds else self.frames
        return max(1, round(frames / self.speed)) + bool(own_seconds and not self.seconds)
