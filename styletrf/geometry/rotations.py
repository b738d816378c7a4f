"""Rotations as unit quaternions `w x y z`: to matrices and back, and the arc between two.

`q` and `-q` are the same rotation; `aligned` chooses the signs along a sequence so that neighbors
are less than half a turn apart, as interpolation requires.
"""

import numpy as np
from jaxtyping import Float

Quaternions = Float[np.ndarray, "n 4"]
Rotations = Float[np.ndarray, "n 3 3"]

_PARALLEL = 1e-9  # sine of the half angle below which an arc is a straight line


def quaternions_of(rotations: Rotations) -> Quaternions:
    """Returns the unit quaternions of rotation matrices, with w >= 0.

    Each is the eigenvector of the largest eigenvalue of a symmetric 4x4 matrix (Bar-Itzhack 2000),
    which is well defined for every rotation, half turns among them.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = np.moveaxis(rotations, 0, -1)
    symmetric = np.stack([
        np.stack([xx + yy + zz, zy - yz, xz - zx, yx - xy], axis=-1),
        np.stack([zy - yz, xx - yy - zz, xy + yx, xz + zx], axis=-1),
        np.stack([xz - zx, xy + yx, yy - xx - zz, yz + zy], axis=-1),
        np.stack([yx - xy, xz + zx, yz + zy, zz - xx - yy], axis=-1),
    ], axis=-2)  # fmt: skip
    largest = np.linalg.eigh(symmetric)[1][..., -1]
    quaternions: Quaternions = np.where(largest[:, :1] < 0, -largest, largest)
    return quaternions


def matrices_of(quaternions: Quaternions) -> Rotations:
    """Returns the rotation matrices of quaternions of any positive length."""
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def aligned(quaternions: Quaternions) -> Quaternions:
    """Returns the same rotations with signs such that neighbors have no negative product."""
    products = (quaternions[1:] * quaternions[:-1]).sum(axis=1)
    signs = np.cumprod(np.concatenate([[1.0], np.where(products < 0, -1.0, 1.0)]))
    result: Quaternions = quaternions * signs[:, None]
    return result


def slerp(a: Quaternions, b: Quaternions, fraction: Float[np.ndarray, "n 1"]) -> Quaternions:
    """Returns the quaternions at fractions of the arcs from `a` to `b` (Shoemake 1985).

    Fractions outside of [0, 1] go on beyond the ends. The arc is the one of the quaternions as they
    are given, not of the nearest signs: a spline would jump where these change.
    """
    half = np.linalg.norm(b - a, axis=1, keepdims=True) / 2
    angle = 2 * np.arcsin(np.clip(half, 0, 1))
    sine = np.sin(angle)
    is_line = sine < _PARALLEL
    safe = np.where(is_line, 1.0, sine)
    weight_a = np.where(is_line, 1 - fraction, np.sin((1 - fraction) * angle) / safe)
    weight_b = np.where(is_line, fraction, np.sin(fraction * angle) / safe)
    mixed = weight_a * a + weight_b * b
    length = np.linalg.norm(mixed, axis=1, keepdims=True)
    unit: Quaternions = np.where(length > _PARALLEL, mixed / np.maximum(length, _PARALLEL), a)
    return unit


def angles_between(a: Quaternions, b: Quaternions) -> Float[np.ndarray, " n"]:
    """Returns the angles in radians, at most half a turn, between rotations."""
    apart = np.minimum(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))
    angles: Float[np.ndarray, " n"] = 4 * np.arcsin(np.clip(apart / 2, 0, 1))
    return angles
