"""The smoothed way of the photographers through a scene, which a path can follow.

A walk looks neither at one place nor away from one. The photographs are put in the order in which
they were taken, or in that of nearest neighbors where that way is shorter; a point of the path is
the mean of the photographs near it, weighted by a Gaussian over their number. Photographs from one
place count as one. Where photographs near each other look all around, as views of a panorama do, or
to the left and to the right by turns, their mean direction means nothing and the path looks ahead.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from styletrf.geometry.cameras import Camera

Points = Float[np.ndarray, "places 3"]
Fractions = Float[np.ndarray, " places"]
Centers = Float[np.ndarray, "views 3"]

SMOOTHING = 1.5  # photographs
_ONE_PLACE = 1e-6  # of the extent of all places
_ALL_AROUND = 0.5  # length of the mean of unit directions
_CLOSED = 4.0  # median steps between the last photograph and the first of a round
_MOST_SMOOTHED = 1 / 16  # of all photographs: a round keeps 93 % of its radius
_DENSE = 32  # places a photograph at which the way is measured


def smoothed_walkthrough(
    cameras: Sequence[Camera], fractions: Fractions, *, back: bool
) -> tuple[Points, Points]:
    """Returns centers and unit directions of view at fractions, from 0 to 1, of the way taken.

    A round is followed once. Another way is followed to its end and, with `back`, back again, so
    that the path closes.
    """
    centers, forwards = _places(cameras)
    order = _shortest_order(centers)
    centers, forwards = centers[order], forwards[order]
    closed = is_closed(centers)
    if not closed:
        fractions = 0.5 - 0.5 * np.cos(2 * np.pi * fractions) if back else fractions
    number = _by_length(centers, fractions, closed=closed)
    weights = gaussian_weights(number, len(centers), closed=closed)
    near = weights_between(centers, SMOOTHING)
    if _cancel(near @ forwards):
        forwards = _directions(near @ centers, closed=closed)
    ahead = weights @ forwards
    return weights @ centers, ahead / np.linalg.norm(ahead, axis=1, keepdims=True)


def looks_all_around(cameras: Sequence[Camera], deviation: float = SMOOTHING) -> bool:
    """Returns whether photographs near each other look in many directions, at most places.

    Args:
        cameras: The photographs' in their order.
        deviation: Of the weights by which directions are averaged, in places.
    """
    centers, forwards = _places(cameras)
    return _cancel(weights_between(centers, deviation) @ forwards)


def onwards(cameras: Sequence[Camera], deviation: float = SMOOTHING) -> tuple[Centers, Centers]:
    """Returns the places of photographs, and the unit direction of the smoothed way at each."""
    centers, _ = _places(cameras)
    way = weights_between(centers, deviation) @ centers
    return centers, _directions(way, closed=is_closed(centers))


def _cancel(directions: Centers) -> bool:
    """Returns whether mean directions of view are too short to mean something, at most places."""
    return bool(np.median(np.linalg.norm(directions, axis=1)) < _ALL_AROUND)


def _places(cameras: Sequence[Camera]) -> tuple[Centers, Centers]:
    """Returns the places where photographs were taken, and the mean direction of view at each.

    The mean is short where they look in many directions.
    """
    centers = np.stack([camera.center_world for camera in cameras])
    forwards = np.stack([camera.forward_world for camera in cameras])
    extent = np.ptp(centers, axis=0).max()
    apart = np.linalg.norm(np.diff(centers, axis=0), axis=1) > _ONE_PLACE * extent
    starts = np.append(0, np.flatnonzero(apart) + 1)
    counts = np.diff(np.append(starts, len(centers)))
    return centers[starts], np.add.reduceat(forwards, starts) / counts[:, None]


def _directions(centers: Centers, *, closed: bool) -> Centers:
    """Returns the unit direction from each place's predecessor to its successor.

    For a single place it is the z axis.
    """
    if len(centers) == 1:
        return np.array([[0.0, 0.0, 1.0]])
    around = np.pad(centers, ((1, 1), (0, 0)), mode="wrap" if closed else "edge")
    way = around[2:] - around[:-2]
    return np.asarray(way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12))


def _shortest_order(centers: Centers) -> Int[np.ndarray, " views"]:
    taken = np.arange(len(centers))
    return min((taken, _by_neighbors(centers)), key=lambda order: _length(centers[order]))


def _by_neighbors(centers: Centers) -> Int[np.ndarray, " views"]:
    """Returns the order that goes on to the nearest photograph left, from one at an end."""
    first = int(np.linalg.norm(centers - centers.mean(axis=0), axis=1).argmax())
    order, left = [first], set(range(len(centers))) - {first}
    while left:
        rest = np.array(sorted(left))
        away = np.linalg.norm(centers[rest] - centers[order[-1]], axis=1)
        order.append(int(rest[away.argmin()]))
        left.remove(order[-1])
    return np.array(order)


def _length(centers: Centers) -> float:
    return float(np.linalg.norm(np.diff(centers, axis=0), axis=1).sum())


def is_closed(centers: Centers) -> bool:
    """Returns whether the last photograph is about as near to the first as neighbors are."""
    if len(centers) < 3:
        return False
    steps = np.linalg.norm(np.diff(centers, axis=0), axis=1)
    gap = np.linalg.norm(centers[-1] - centers[0])
    return bool(gap <= _CLOSED * np.median(steps) and gap < 0.2 * steps.sum())


def _by_length(
    centers: Centers, fraction: Float[np.ndarray, " places"], *, closed: bool
) -> Float[np.ndarray, " places"]:
    """Returns the number of the photograph, in fractions, at fractions of the smoothed way."""
    n = len(centers)
    number = np.linspace(0, n if closed else n - 1, _DENSE * n + 1)
    way = gaussian_weights(number, n, closed=closed) @ centers
    length = np.concatenate([[0.0], np.linalg.norm(np.diff(way, axis=0), axis=1).cumsum()])
    result: Float[np.ndarray, " places"] = np.interp(fraction * length[-1], length, number)
    return result


def weights_between(centers: Centers, deviation: float) -> Float[np.ndarray, "views views"]:
    """Returns the weights, of sum 1, that photographs have at each other's places.

    Args:
        centers: Of the photographs, in their order.
        deviation: In photographs. Of a round a sixteenth of all at most: more draws it inwards.
    """
    n, closed = len(centers), is_closed(centers)
    if closed:
        deviation = min(deviation, _MOST_SMOOTHED * n)
    if deviation == 0:
        return np.eye(n)
    number = np.arange(float(n))
    return gaussian_weights(number, n, closed=closed, deviation=deviation)


def gaussian_weights(
    number: Fractions, n: int, *, closed: bool, deviation: float = SMOOTHING
) -> Float[np.ndarray, "places views"]:
    """Returns the weights, of sum 1, that n photographs have at places between them."""
    away = np.abs(number[:, None] - np.arange(n))
    if closed:
        away = np.minimum(away, n - away)
    weights = np.exp(-((away / deviation) ** 2) / 2)
    normalized: Float[np.ndarray, "places views"] = weights / weights.sum(axis=1, keepdims=True)
    return normalized
