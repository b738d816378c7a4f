"""The ring, or the arc of one, on which photographs were taken around a scene."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from styletrf.geometry.cameras import Camera
from styletrf.scene.scene_model import SceneModel

Points = Float[np.ndarray, "frames 3"]
Fractions = Float[np.ndarray, " frames"]


@dataclass(frozen=True, slots=True)
class Ring:
    """The positions of photographs around the vertical through the focus.

    `low` and `high` are distance from the vertical and height, medians of either half of the
    photographs by height. A ring that is not `closed` is an arc from `start` of `extent` radians.
    """

    focus: Float[np.ndarray, " 3"]
    start: float
    extent: float
    closed: bool
    low: Float[np.ndarray, " 2"]
    high: Float[np.ndarray, " 2"]

    def points(self, along: Fractions, rise: Fractions) -> Points:
        """Returns the points at fractions of the way along, and between low and high."""
        angles = self.start + self.extent * along
        radius, height = self.low[:, None] + np.outer(self.high - self.low, rise)
        around = np.stack([radius * np.sin(angles), height, radius * np.cos(angles)], axis=-1)
        points: Points = self.focus + around
        return points


def ring_of(cameras: Sequence[Camera], model: SceneModel) -> Ring:
    """Returns the ring of the photographs, closed where no gap is wider than 60 degrees."""
    focus = np.array(model.focus)
    offsets = np.stack([camera.center_world for camera in cameras]) - focus
    azimuths = np.sort(np.arctan2(offsets[:, 0], offsets[:, 2]))
    gaps = np.diff(np.append(azimuths, azimuths[0] + 2 * np.pi))
    widest = int(gaps.argmax())
    profile = np.column_stack([np.hypot(offsets[:, 0], offsets[:, 2]), offsets[:, 1]])
    by_height = profile[np.argsort(profile[:, 1])]
    half = (len(profile) + 1) // 2
    closed = bool(gaps[widest] < np.radians(60))
    return Ring(
        focus=focus,
        start=float(azimuths[(widest + 1) % len(azimuths)]),
        extent=2 * np.pi if closed else float(2 * np.pi - gaps[widest]),
        closed=closed,
        low=np.median(by_height[:half], axis=0),
        high=np.median(by_height[-half:], axis=0),
    )
