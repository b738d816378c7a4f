"""Dots of nearly pure color."""

import cv2
import numpy as np

from styletrf.synthetic.paintings.canvas import (
    FINE,
    Canvas,
    Field,
    Painting,
    coordinates,
    finished,
    noise,
    ramp,
    rgb,
)


def dots(seed: int = 0) -> Painting:
    """Returns a bay at noon in dots of nearly pure color."""
    rng = np.random.default_rng([seed, 4])
    x, y = coordinates()
    picture = _bay(x, y, rng)
    canvas = np.ones((FINE, FINE, 3)) * rgb("#efe4c9")
    for radius, count in ((13, 6500), (10, 10500), (7, 9000)):
        for px, py in rng.uniform(0, FINE - 1, (count, 2)):
            color = picture[int(py), int(px)] + rng.normal(0, 0.09, 3)
            if rng.uniform() < 0.13:  # the complement, as the pointillists set it beside
                color = 2 * color.mean() - color
            color = np.clip(color.mean() + 1.35 * (color - color.mean()), 0, 1)
            axes = radius * rng.uniform(0.75, 1.15, 2)
            center, half = np.rint(16 * np.array([[px, py], axes])).astype(int).tolist()
            turn = rng.uniform(0, 180)
            cv2.ellipse(canvas, center, half, turn, 0, 360, color.tolist(), -1, cv2.LINE_AA, 4)
    return finished(canvas)


def _bay(x: Field, y: Field, rng: np.random.Generator) -> Canvas:
    """Returns the picture the dots take their color from."""
    sky = ramp(y, "#3f8fd6 #7cc0e6 #f6d9a8 #f9b48a", 0.0, 0.42)
    cloud = np.clip(noise(220, rng) - 0.5, 0, 1)[..., None]
    sky = (1 - cloud) * sky + cloud * rgb("#fff3e0")
    glitter = np.sin(130 * y + 5 * np.sin(16 * x)) * np.exp(-(((x - 0.62) / 0.16) ** 2))
    sea = ramp(y, "#2f9fb8 #1f6fb0 #2b4fa0", 0.42, 0.78)
    sea = np.where((glitter > 0.25)[..., None], rgb("#ffd873"), sea)
    hill = y > 0.36 - 0.17 * np.exp(-(((x - 0.2) / 0.17) ** 2)) + 0.06 * x
    far = ramp(y, "#8a6fc0 #5d6fb8 #4f9a94", 0.2, 0.44)
    picture = np.where((y > 0.42)[..., None], sea, np.where(hill[..., None], far, sky))
    shore = y > 0.76 + 0.05 * np.sin(6 * x + 1.2) - 0.1 * x
    sand = ramp(y - 0.1 * np.sin(9 * x), "#f0c36a #e88f4a #c7503f", 0.7, 1.0)
    picture = np.where(shore[..., None], sand, picture)
    for cx, cy, r in ((0.16, 0.56, 0.15), (0.04, 0.7, 0.14), (0.28, 0.68, 0.1), (0.93, 0.72, 0.12)):
        distance = np.hypot(x - cx, (y - cy) * 1.1) / r + 0.12 * noise(40, rng)
        tree = ramp(distance + 1.2 * (y - cy), "#e3d23f #6fb53a #1f7f4a #174a66", 0.1, 1.1)
        picture = np.where((distance < 1)[..., None], tree, picture)
    sail = (np.abs(x - 0.58) < 0.5 * (y - 0.3)) & (y < 0.47) & (x > 0.545)
    return np.where(sail[..., None], rgb("#fff1d6"), picture)
