"""A leaded window."""

import cv2
import numpy as np

from styletrf.synthetic.paintings.canvas import (
    FINE,
    Field,
    Labels,
    Painting,
    Points,
    coordinates,
    finished,
    noise,
    rgb,
)


def stained_glass(seed: int = 0) -> Painting:
    """Returns a sun over hills and a river in leaded glass."""
    rng = np.random.default_rng([seed, 1])
    x, y = coordinates()
    dx, dy = x - 0.5, y - 0.36
    rings, turns = np.hypot(dx, dy), np.arctan2(dy, dx) / (2 * np.pi)
    pieces = _pieces(_scattered(340, rng), 0.008, rng)
    regions = _glass_regions(x, y, rings, turns)
    joint = pieces + 4096 * regions
    _, labels = np.unique(joint, return_inverse=True)
    labels = labels.reshape(joint.shape).astype(np.int32)
    palettes = [
        "#ffd23f #ffb01f #ff8c1a #fff07a", "#f2571b #e8331f #ff7a29 #d81e4a",
        "#1f5fd0 #2a86e8 #143fa6 #45b5f0", "#5b2a9e #7a3cc4 #3a2390 #a146c8",
        "#118a4a #2fb457 #0c6b4f #8fcf3c", "#0fa3a3 #0c7f9c #35c9bd #0a5f86",
        "#b3122d #d9262e #8a1038 #f04f3c",
    ]  # fmt: skip
    colors = np.zeros((labels.max() + 1, 3))
    for region, names in enumerate(palettes):
        inside = np.unique(labels[regions == region])
        shades = np.stack([rgb(name) for name in names.split()])
        colors[inside] = shades[rng.integers(len(shades), size=len(inside))]
    colors *= rng.uniform(0.92, 1.25, (len(colors), 1))
    streaks = 0.10 * noise(70, rng, stretch=5) + 0.07 * noise(12, rng)
    glass = colors[labels] * (1 + streaks)[..., None]
    distance = _distance_to_edges(labels)
    glow = (0.80 + 0.34 * np.clip(distance / 26, 0, 1))[..., None]
    leading = 3.6 + 0.8 * noise(60, rng) + 2.0 * _on_edges(regions, 8.0)
    lead = np.clip(distance - leading, 0, 1.5)[..., None] / 1.5
    return finished(lead * glass * glow + (1 - lead) * rgb("#120f14"))


def _glass_regions(x: Field, y: Field, rings: Field, turns: Field) -> Labels:
    """Returns which of seven palettes each pixel of the window takes."""
    rays = (np.floor(turns * 24 + 1.2 * np.sin(9 * rings)) % 2).astype(int)
    regions = np.where(rings < 0.13, 0, np.where(rings < 0.19, 1, 2 + rays))
    hills = y > 0.62 + 0.07 * np.sin(7 * x + 0.6) + 0.03 * np.sin(17 * x)
    near = y > 0.76 + 0.06 * np.sin(5 * x + 2.4)
    river = np.abs(x - 0.5 - 0.16 * np.sin(9 * y)) < 0.05 + 0.22 * (y - 0.62)
    regions = np.where(hills, 4, regions)
    regions = np.where(near, 6, regions)
    return np.where(hills & river, 5, regions)


def _scattered(count: int, rng: np.random.Generator) -> Points:
    """Returns points spread over the canvas, none too near another (Mitchell's best candidate)."""
    points = rng.uniform(0, FINE, (1, 2))
    for _ in range(count - 1):
        candidates = rng.uniform(0, FINE, (12, 2))
        distance = np.linalg.norm(candidates[:, None] - points, axis=-1).min(axis=1)
        points = np.concatenate([points, candidates[[distance.argmax()]]])
    return points


def _pieces(points: Points, bend: float, rng: np.random.Generator) -> Labels:
    """Returns the number of the nearest point at each pixel, the borders bent a little."""
    x, y = coordinates()
    seeds = np.ones((FINE, FINE), np.uint8)
    columns, rows = points.astype(int).T
    seeds[rows, columns] = 0
    _, nearest = cv2.distanceTransformWithLabels(seeds, cv2.DIST_L2, cv2.DIST_MASK_5)
    columns, rows = (
        np.clip((a + bend * noise(90, rng)) * FINE, 0, FINE - 1).astype(int) for a in (x, y)
    )
    return np.asarray(nearest[rows, columns], dtype=np.int64)


def _distance_to_edges(labels: Labels) -> Field:
    """Returns the distance of each pixel to the nearest change of label, in pixels."""
    edges = np.zeros(labels.shape, bool)
    edges[:, 1:] |= labels[:, 1:] != labels[:, :-1]
    edges[1:] |= labels[1:] != labels[:-1]
    return cv2.distanceTransform((~edges).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)


def _on_edges(labels: Labels, reach: float) -> Field:
    """Returns one near changes of label, falling to zero beyond `reach` pixels."""
    return np.clip(2 - _distance_to_edges(labels) / reach, 0, 1)
