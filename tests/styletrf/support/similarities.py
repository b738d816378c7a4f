"""Similarities between solved and true cameras."""

import numpy as np


def similarity(source, target):
    """Returns scale and rotation of the best similarity between point sets (Umeyama 1991)."""
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    u, singular, vt = np.linalg.svd(b.T @ a)
    sign = np.diag([1, 1, np.sign(np.linalg.det(u @ vt))])
    return (singular * np.diag(sign)).sum() / (a**2).sum(), u @ sign @ vt
