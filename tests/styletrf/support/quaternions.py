"""Quaternions for tests: any, and turns about an axis."""

import numpy as np


def any_quaternions(n: int = 200, seed: int = 0) -> np.ndarray:
    values = np.random.default_rng(seed).normal(size=(n, 4))
    return values / np.linalg.norm(values, axis=1, keepdims=True)


def about(axis: int, angle_rad: float) -> np.ndarray:
    quaternion = np.zeros(4)
    quaternion[0], quaternion[1 + axis] = np.cos(angle_rad / 2), np.sin(angle_rad / 2)
    return quaternion[None]
