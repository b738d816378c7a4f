"""Camera paths: a spiral where the photographers looked ahead, an orbit, or the way they went.

All in the normalised world, whose y axis points down. Paths stay within what the photographs saw:
amplitudes are shares of the spread of the given cameras. `fly_through` is the closed path of the
video, `prior_views` the viewpoints that fill what it goes around or along.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from styletrf.cameras import Camera
from styletrf.scene_model import SceneModel
from styletrf.typical_view import typical_view
from styletrf.walk import along_the_walk

Points = Float[np.ndarray, "frames 3"]
Shares = Float[np.ndarray, " frames"]

GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


@dataclass(frozen=True, slots=True)
class TrajectoryConfig:
    """A path of `frames` cameras.

    `turns` counts revolutions of the fly-through before a forward-facing scene, whole ones or it
    would not close; `spread` is the share of the photographs' own spread that the path uses.
    """

    frames: int = 60
    turns: float = 1.0
    spread: float = 0.7

    def __post_init__(self) -> None:
        if self.frames < 1:
            raise ValueError(f"a path of {self.frames} frames shows nothing")
        if self.turns < 1 or self.turns != int(self.turns):
            raise ValueError(f"a path of {self.turns} turns is not closed, as whole turns are")


def fly_through(
    cameras: Sequence[Camera], model: SceneModel, config: TrajectoryConfig
) -> list[Camera]:
    """Returns a closed, smooth path for the scene, with the intrinsics of a typical photograph.

    Args:
        cameras: The photographs' cameras in the normalised world, at the working size.
        model: Decides between spiral and orbit, and where the frames look.
        config: Length and amplitude.
    """
    phases = 2 * np.pi * np.arange(config.frames) / config.frames
    if model.looking == "ahead":
        across = config.turns * phases
        waves = np.stack([np.cos(across), -np.sin(across), -np.sin(phases)], axis=-1)
        centers = _before_the_scene(cameras, waves, config.spread)
    elif model.looking == "along":
        return _facing(*along_the_walk(cameras, config.frames, back=True), typical_view(cameras))
    else:
        ring = _ring(cameras, model)
        to_and_fro = 0.5 + 0.5 * config.spread * np.sin(phases)
        along = phases / (2 * np.pi) if ring.closed else to_and_fro
        centers = ring.points(along, 0.5 + 0.5 * config.spread * np.sin(2 * phases))
    return _looking(centers, typical_view(cameras), model)


def prior_views(
    cameras: Sequence[Camera], model: SceneModel, config: TrajectoryConfig
) -> list[Camera]:
    """Returns viewpoints, no two alike, spread evenly over what the fly-through encloses.

    Before a forward-facing scene a sunflower's seeds (Vogel 1979) over the ellipse; around another
    evenly spaced azimuths, low and high by turns; along a walk evenly spaced places.
    """
    index = np.arange(config.frames)
    if model.looking == "ahead":
        angles = GOLDEN_ANGLE * index
        seeds = np.stack([np.cos(angles), -np.sin(angles), -np.sin(angles)], axis=-1)
        seeds *= np.sqrt((index + 0.5) / config.frames)[:, None]
        centers = _before_the_scene(cameras, seeds, config.spread)
    elif model.looking == "along":
        return _facing(*along_the_walk(cameras, config.frames, back=False), typical_view(cameras))
    else:
        ring = _ring(cameras, model)
        even = (index + 0.5) / config.frames
        along = even if ring.closed else 0.5 + config.spread * (even - 0.5)
        centers = ring.points(along, 0.5 + config.spread * (index % 2 - 0.5))
    return _looking(centers, typical_view(cameras), model)


def look_at(
    center: Float[np.ndarray, " 3"], target: Float[np.ndarray, " 3"], down: np.ndarray
) -> Float[np.ndarray, "3 4"]:
    """Returns world_from_camera at `center` with z towards `target` and y near `down`.

    At the target itself it looks along the world's z.
    """
    distance = np.linalg.norm(target - center)
    z = (target - center) / distance if distance > 0 else np.array([0.0, 0.0, 1.0])
    x = np.cross(down, z)
    x = x / np.linalg.norm(x) if np.linalg.norm(x) > 1e-9 else np.array([1.0, 0.0, 0.0])
    return np.column_stack([x, np.cross(z, x), z, center])


def _looking(centers: Points, photograph: Camera, model: SceneModel) -> list[Camera]:
    """Returns cameras at the centres that look at the focus, or away from it."""
    focus = np.array(model.focus)
    return _facing(
        centers, centers - focus if model.looking == "outward" else focus - centers, photograph
    )


def _facing(centers: Points, directions: Points, photograph: Camera) -> list[Camera]:
    """Returns level cameras at the centres, with the intrinsics of a photograph."""
    centered = replace(photograph, cx=photograph.width / 2, cy=photograph.height / 2)
    return [
        replace(
            centered,
            name=f"{k:04d}",
            world_from_camera=look_at(center, center + direction, np.array([0, 1, 0])),
        )
        for k, (center, direction) in enumerate(zip(centers, directions, strict=True))
    ]


def _before_the_scene(cameras: Sequence[Camera], shares: Points, spread: float) -> Points:
    """Returns points at shares of the ellipsoid that the cameras fill."""
    centers = np.stack([camera.center_world for camera in cameras])
    radii = spread * np.percentile(np.abs(centers - centers.mean(axis=0)), 90, axis=0)
    points: Points = centers.mean(axis=0) + radii * shares
    return points


@dataclass(frozen=True, slots=True)
class _Ring:
    """Where photographs were taken around the vertical through the focus.

    `low` and `high` are distance from the vertical and height, medians of either half of the
    photographs by height. What is not `closed` is an arc from `start` of `extent` radians.
    """

    focus: Float[np.ndarray, " 3"]
    start: float
    extent: float
    closed: bool
    low: Float[np.ndarray, " 2"]
    high: Float[np.ndarray, " 2"]

    def points(self, along: Shares, rise: Shares) -> Points:
        """Returns the points at shares of the way along, and between low and high."""
        angles = self.start + self.extent * along
        radius, height = self.low[:, None] + np.outer(self.high - self.low, rise)
        around = np.stack([radius * np.sin(angles), height, radius * np.cos(angles)], axis=-1)
        points: Points = self.focus + around
        return points


def _ring(cameras: Sequence[Camera], model: SceneModel) -> _Ring:
    focus = np.array(model.focus)
    offsets = np.stack([camera.center_world for camera in cameras]) - focus
    azimuths = np.sort(np.arctan2(offsets[:, 0], offsets[:, 2]))
    gaps = np.diff(np.append(azimuths, azimuths[0] + 2 * np.pi))
    widest = int(gaps.argmax())
    profile = np.column_stack([np.hypot(offsets[:, 0], offsets[:, 2]), offsets[:, 1]])
    by_height = profile[np.argsort(profile[:, 1])]
    half = (len(profile) + 1) // 2
    closed = bool(gaps[widest] < np.radians(60))
    return _Ring(
        focus=focus,
        start=float(azimuths[(widest + 1) % len(azimuths)]),
        extent=2 * np.pi if closed else float(2 * np.pi - gaps[widest]),
        closed=closed,
        low=np.median(by_height[:half], axis=0),
        high=np.median(by_height[-half:], axis=0),
    )
