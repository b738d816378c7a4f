"""A smooth curve through the poses of key frames, and even speed along it.

Between two key frames lies a Catmull-Rom piece, built from linear interpolations alone (Barry and
Goldman 1988); with arcs instead of lines the same construction serves rotations (Schlag 1991). The
curve and its derivative are continuous. Key frames get centripetal knots, with which a curve has no
cusps and no loops within a piece (Yuksel et al. 2011). Focal lengths, and the times of key frames,
follow a monotone cubic (Fritsch and Butland 1984), which never leaves the range of two neighbors.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from styletrf.geometry.rotations import aligned, angles_between, slerp

Places = Float[np.ndarray, " places"]
Knots = Float[np.ndarray, " knots"]
Blend = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]

TURN = 0.5
"""The distance in the normalized world that counts as much as a turn by one radian.

The center of the camera moves at an even speed, and more slowly where the camera would turn faster
than that: a turn on the spot takes time, too.
"""
ZOOM = 0.25
"""The distance that counts as much as a change of the focal length by the factor e.

At an angle of view of 53 degrees a picture's edge then moves as far as its middle does in a turn.
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
        piece = _pieces(self.knots, parameters)
        return Poses(
            self._through(self.poses.centers, piece, parameters, _lerp),
            self._through(self.poses.quaternions, piece, parameters, slerp),
            np.exp(_monotone(self.knots, np.log(self.poses.focals), parameters)),
        )

    def at_times(self, times_s: Places, key_times_s: Knots) -> Poses:
        """Returns the poses at times, of an open curve.

        The times change the speed alone, not the curve: between two key frames at one place the
        camera stays there.

        Args:
            times_s: Any from the first to the last of `key_times_s`.
            key_times_s: The times of the key frames, ascending, in seconds.
        """
        steps = np.diff(key_times_s)
        before, after = key_times_s[:1] - steps[:1], key_times_s[-1:] + steps[-1:]
        return self.at(_monotone(np.concatenate([before, key_times_s, after]), self.knots, times_s))

    def at_fractions(self, fractions: Places) -> Poses:
        """Returns the poses at fractions in [0, 1] of the way, as `ways_between` measures it."""
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


def curve_through(keys: Poses, *, closed: bool = False) -> CameraCurve:
    """Returns the curve through key frames; the curve of a single one stays there.

    Args:
        keys: The poses, one or more.
        closed: Whether the curve returns to the first one.
    """
    if len(keys) == 1:
        keys = _chosen(keys, np.array([0, 0]))
    order = np.arange(len(keys))
    if closed:
        order = np.concatenate([order[-1:], order, order[:2]])
    poses = _chosen(keys, order)
    poses = Poses(poses.centers, aligned(poses.quaternions), poses.focals)
    steps = _intervals(poses)
    if closed:
        return CameraCurve(poses, np.concatenate([[0.0], steps.cumsum()]), closed=True)
    steps = np.concatenate([steps[:1], steps, steps[-1:]])
    knots = np.concatenate([[0.0], steps.cumsum()]) - steps[0]
    return CameraCurve(_extended(poses), knots, closed=False)


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
    """Returns the way from each pose to the next: the longest of move, turn and zoom."""
    ways: Places = np.maximum(_ways_moved(poses), ZOOM * np.abs(np.diff(np.log(poses.focals))))
    return ways


def _ways_moved(poses: Poses) -> Places:
    moved = np.linalg.norm(np.diff(poses.centers, axis=0), axis=1)
    turned = angles_between(poses.quaternions[:-1], poses.quaternions[1:])
    ways: Places = np.maximum(moved, TURN * turned)
    return ways


def _chosen(poses: Poses, order: np.ndarray) -> Poses:
    return Poses(poses.centers[order], poses.quaternions[order], poses.focals[order])


def _intervals(poses: Poses) -> Places:
    """Returns the centripetal intervals between knots, none of them zero.

    The lens has no part in them, so that a center stays where it is during a zoom.
    """
    steps = np.sqrt(_ways_moved(poses))
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


def _pieces(places: Knots, at: Places) -> np.ndarray:
    """Returns the index of the last of the inner places that is not beyond each of `at`."""
    return np.clip(np.searchsorted(places, at, side="right") - 1, 1, len(places) - 3)


def _monotone(places: Knots, values: Knots, at: Places) -> Places:
    """Returns values between the second place and the last but one, each between its neighbors'.

    The slope at a place is a weighted harmonic mean of those beside it; 0 at an extremum.
    """
    widths, rises = np.diff(places), np.diff(values)
    (w0, w1), (d0, d1) = ((each[:-1], each[1:]) for each in (widths, rises / widths))
    goes_on = d0 * d1 > 0
    parts = (2 * w1 + w0) * d1 + (w1 + 2 * w0) * d0
    slopes = np.where(goes_on, 3 * (w0 + w1) * d0 * d1 / np.where(goes_on, parts, 1.0), 0.0)
    piece = _pieces(places, at)
    s = (at - places[piece]) / widths[piece]
    bend = slopes[piece - 1] * s * (1 - s) ** 2 - slopes[piece] * s**2 * (1 - s)
    smooth: Places = values[piece] + rises[piece] * (3 - 2 * s) * s**2 + widths[piece] * bend
    return smooth
