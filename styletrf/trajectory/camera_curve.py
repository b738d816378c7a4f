"""A smooth curve through the poses of key frames, and even speed along it.

Between two key frames lies a Catmull-Rom piece, built from linear interpolations alone (Barry and
Goldman 1988); with arcs instead of lines the same construction serves rotations (Schlag 1991). The
curve and its derivative are continuous. Without times of their own, key frames get centripetal
knots, with which a curve has no cusps and no loops within a piece (Yuksel et al. 2011).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from styletrf.geometry.rotations import aligned, angles_between, slerp

Places = Float[np.ndarray, " places"]
Blend = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]

TURN = 0.5
"""The distance in the normalized world that counts as much as a turn by one radian.

The center of the camera moves at an even speed, and more slowly where the camera would turn faster
than that: a turn on the spot takes time, too.
"""
_FINENESS = 512  # samples of each piece by which the way is measured
_CLOSEST = 1e-3  # of the widest interval between knots


@dataclass(frozen=True, slots=True)
class Poses:
    """The cameras of a path: centers, unit quaternions `w x y z` and focal lengths.

    Quaternions turn the camera's axes into the world's. Focal lengths are in units of the longer
    side of an image.
    """

    centers: Float[np.ndarray, "n 3"]
    quaternions: Float[np.ndarray, "n 4"]
    focals: Float[np.ndarray, " n"]

    def __len__(self) -> int:
        return len(self.centers)


@dataclass(frozen=True, slots=True)
class CameraCurve:
    """The curve through poses: those of the key frames, with one more before and one after.

    A closed curve returns to the first key frame, which is there twice. `knots` are the parameters
    of all these; the curve itself begins at the second one and ends at the last but one.
    """

    poses: Poses
    knots: Float[np.ndarray, " n"]
    closed: bool

    @property
    def key_knots(self) -> Float[np.ndarray, " keys"]:
        """The parameters of the key frames; of a closed curve also that of its return."""
        return self.knots[1:-1]

    def at(self, parameters: Places) -> Poses:
        """Returns the poses at parameters from the first to the last of `key_knots`."""
        last = len(self.knots) - 3
        piece = np.clip(np.searchsorted(self.knots, parameters, side="right") - 1, 1, last)
        return Poses(
            self._through(self.poses.centers, piece, parameters, _lerp),
            self._through(self.poses.quaternions, piece, parameters, slerp),
            np.exp(self._through(np.log(self.poses.focals)[:, None], piece, parameters, _lerp))[
                :, 0
            ],
        )

    def at_fractions(self, fractions: Places) -> Poses:
        """Returns the poses at fractions in [0, 1] of the way, as `TURN` measures it."""
        inner = self.key_knots
        fine = np.arange(_FINENESS) / _FINENESS
        table = np.append((inner[:-1, None] + np.diff(inner)[:, None] * fine).ravel(), inner[-1])
        way = np.concatenate([[0.0], ways_between(self.at(table)).cumsum()])
        return self.at(np.interp(fractions * way[-1], way, table))

    def _through(
        self, values: np.ndarray, piece: np.ndarray, at: Places, blend: Blend
    ) -> np.ndarray:
        v0, v1, v2, v3 = (values[piece + k] for k in (-1, 0, 1, 2))
        t0, t1, t2, t3 = (self.knots[piece + k] for k in (-1, 0, 1, 2))

        def fraction(start: np.ndarray, end: np.ndarray) -> np.ndarray:
            fractions: np.ndarray = (at - start) / (end - start)
            return fractions[:, None]

        a, b, c = (
            blend(v0, v1, fraction(t0, t1)),
            blend(v1, v2, fraction(t1, t2)),
            blend(v2, v3, fraction(t2, t3)),
        )
        point: np.ndarray = blend(
            blend(a, b, fraction(t0, t2)), blend(b, c, fraction(t1, t3)), fraction(t1, t2)
        )
        return point


def curve_through(
    keys: Poses, *, closed: bool = False, times_s: Places | None = None
) -> CameraCurve:
    """Returns the curve through key frames; the curve of a single one stays there.

    Args:
        keys: The poses, one or more.
        closed: Whether the curve returns to the first one.
        times_s: The times of the key frames of an open curve, ascending: they become its
            parameters.
    """
    if len(keys) == 1:
        keys = _chosen(keys, np.array([0, 0]))
        times_s = None
    order = np.arange(len(keys))
    if closed:
        order = np.concatenate([order[-1:], order, order[:2]])
    poses = _chosen(keys, order)
    poses = Poses(poses.centers, aligned(poses.quaternions), poses.focals)
    if closed:
        steps = _intervals(poses)
        return CameraCurve(poses, np.concatenate([[0.0], steps.cumsum()]), closed=True)
    steps = _intervals(poses) if times_s is None else np.diff(times_s)
    steps = np.concatenate([steps[:1], steps, steps[-1:]])
    start = -steps[0] + (0.0 if times_s is None else times_s[0])
    return CameraCurve(
        _extended(poses), start + np.concatenate([[0.0], steps.cumsum()]), closed=False
    )


def eased(time: Places, easing: float) -> Places:
    """Returns the fraction of the way at fractions of the time, both from 0 to 1.

    The speed rises evenly during the first half of the fraction `easing` of the time, falls evenly
    during the last half of it, and is constant between.
    """
    ramp = easing / 2
    if ramp < np.finfo(np.float64).eps:  # too short to divide by
        return time
    peak = 1 / (1 - ramp)
    before, after = peak * time**2 / (2 * ramp), 1 - peak * (1 - time) ** 2 / (2 * ramp)
    between = peak * (time - ramp / 2)
    way: Places = np.where(time < ramp, before, np.where(time > 1 - ramp, after, between))
    return way


def ways_between(poses: Poses) -> Places:
    """Returns the way from each pose to the next: that of the center, or of `TURN`, if longer."""
    moved = np.linalg.norm(np.diff(poses.centers, axis=0), axis=1)
    turned = angles_between(poses.quaternions[:-1], poses.quaternions[1:])
    ways: Places = np.maximum(moved, TURN * turned)
    return ways


def _chosen(poses: Poses, order: np.ndarray) -> Poses:
    return Poses(poses.centers[order], poses.quaternions[order], poses.focals[order])


def _intervals(poses: Poses) -> Places:
    """Returns the centripetal intervals between knots, none of them zero."""
    steps = np.sqrt(ways_between(poses))
    widest = float(steps.max())
    intervals: Places = np.maximum(steps, _CLOSEST * widest if widest > 0 else 1.0)
    return intervals


def _extended(poses: Poses) -> Poses:
    """Returns the poses with the second one mirrored at the first, and so at the end."""
    return Poses(
        _with_ends(poses.centers, _lerp),
        _with_ends(poses.quaternions, slerp),
        np.exp(_with_ends(np.log(poses.focals)[:, None], _lerp))[:, 0],
    )


def _with_ends(values: np.ndarray, blend: Blend) -> np.ndarray:
    mirrored = np.array([[-1.0]])
    before = blend(values[:1], values[1:2], mirrored)
    after = blend(values[-1:], values[-2:-1], mirrored)
    return np.concatenate([before, values, after])


def _lerp(a: np.ndarray, b: np.ndarray, fraction: np.ndarray) -> np.ndarray:
    mixed: np.ndarray = (1 - fraction) * a + fraction * b
    return mixed
