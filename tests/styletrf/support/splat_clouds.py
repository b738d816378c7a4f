"""Splats in a cloud before a camera."""

from dataclasses import replace

import numpy as np

from styletrf.exports.splats import (
    Splats,
    splats_of,
)


def cloud(count: int, seed: int = 0) -> Splats:
    rng = np.random.default_rng(seed)
    centers = np.column_stack([rng.uniform(-1, 1, (count, 2)), rng.uniform(3, 5, count)])
    half = rng.normal(size=(count, 3, 3)) * 0.05
    opacities = rng.uniform(0.3, 0.9, count)
    return replace(
        splats_of(centers, half @ half.transpose(0, 2, 1) + 1e-3 * np.eye(3)), opacities=opacities
    )
