"""Thick strokes that follow a field of directions."""

import cv2
import numpy as np
from jaxtyping import Float, Int

from styletrf.synthetic.paintings.canvas import (
    FINE,
    Canvas,
    Color,
    Field,
    Painting,
    Points,
    coordinates,
    finished,
    noise,
    ramp,
    rgb,
)

Starts = Int[np.ndarray, "strokes 2"]
Lines = Float[np.ndarray, "strokes points 2"]


def brush(seed: int = 0) -> Painting:
    """Returns a field under a turning evening sky, in thick strokes that follow the forms."""
    rng = np.random.default_rng([seed, 2])
    x, y = coordinates()
    turn = _swirls(x, y)
    picture = _evening(x, y, rng)
    canvas = picture * 0.8
    for width, count in ((34, 1500), (22, 3400), (13, 6000)):
        starts = rng.uniform(0, FINE - 1, (count, 2)).astype(int)
        lines = _flow_lines(starts, turn, 5.5 * width)
        for (px, py), line, normal in zip(starts.tolist(), lines, _normals(lines), strict=True):
            color = picture[py, px] * rng.uniform(0.75, 1.25) + rng.normal(0, 0.05, 3)
            _stroke(canvas, line, normal, width, color.clip(0, 1), rng)
    return finished(canvas)


def _swirls(x: Field, y: Field) -> Field:
    """Returns the direction of the strokes in radians: around the moons, along the furrows."""
    along, across = np.ones_like(x), 0.25 * np.sin(6 * x + 9 * y)
    for cx, cy, strength, reach in (
        (0.72, 0.22, 3.2, 0.2),
        (0.28, 0.33, -3.0, 0.17),
        (0.5, 0.1, 1.5, 0.1),
    ):
        dx, dy = x - cx, y - cy
        weight = strength * np.exp(-(dx**2 + dy**2) / reach**2) / reach
        along, across = along - weight * dy, across + weight * dx
    slope = np.where(x < 0.5, -1, 1) * 0.9 * np.abs(x - 0.5) + 0.25 * np.sin(12 * x)
    field = y > 0.66
    furrows = np.arctan(slope + 0.5 * (y - 0.66))
    return np.asarray(np.where(field, furrows, np.arctan2(across, along)))


def _evening(x: Field, y: Field, rng: np.random.Generator) -> Canvas:
    """Returns the picture the strokes take their color from."""
    wave = 0.05 * np.sin(11 * x + 4 * y) + 0.04 * noise(120, rng)
    sky = ramp(y + wave, "#0b1f5c #1d4fa8 #2f86c9 #7fc4c9 #f2c86b #ee8a3c", 0.0, 0.68)
    for cx, cy, r in (
        (0.72, 0.22, 0.075),
        (0.28, 0.33, 0.055),
        (0.5, 0.1, 0.03),
        (0.1, 0.12, 0.03),
    ):
        distance = np.hypot(x - cx, y - cy) / r
        halo = np.exp(-(np.maximum(distance - 1, 0) ** 2) / 0.9)[..., None]
        rings = (0.5 + 0.5 * np.cos(5.5 * distance))[..., None]
        light = rings * rgb("#ffe36b") + (1 - rings) * rgb("#f7b733")
        sky = halo * light + (1 - halo) * sky
    furrows = 0.5 + 0.5 * np.sin(70 * (y + 0.4 * np.abs(x - 0.5)) ** 1.4 + 5 * x)
    grass = ramp(furrows, "#1f5d3a #3f8a3a #a8b83a #f0c03c #d9722b", 0.0, 1.0)
    hills = ramp(y + wave, "#28306e #2b5a86 #276a5b", 0.56, 0.72)
    ridge = y > 0.6 + 0.05 * np.sin(8 * x + 1) + 0.02 * np.sin(21 * x)
    land = np.where((y > 0.7 + 0.02 * np.sin(6 * x))[..., None], grass, hills)
    return np.where(ridge[..., None], land, sky)


def _flow_lines(starts: Starts, turn: Field, length: float) -> Lines:
    """Returns a line of the given length through each start, along the directions."""
    halves = []
    for sign in (-1, 1):
        at, half = starts.astype(np.float64), []
        for _ in range(5):
            column, row = np.clip(at.astype(int), 0, FINE - 1).T
            angle = turn[row, column]
            at = at + sign * length / 10 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            half.append(at)
        halves.append(half)
    return np.stack([*halves[0][::-1], starts, *halves[1]], axis=1)


def _normals(lines: Lines) -> Lines:
    """Returns the direction across each line at its points."""
    normals = np.gradient(lines, axis=1)[..., ::-1] * [-1, 1]
    return np.asarray(normals / (np.linalg.norm(normals, axis=2, keepdims=True) + 1e-9))


def _stroke(
    canvas: Canvas,
    line: Points,
    normal: Points,
    width: float | int,
    color: Color,
    rng: np.random.Generator,
) -> None:
    """Draws one stroke of several bristles, lit on one edge and shaded on the other."""
    bristles = max(4, round(width / 4))
    side, breadth = np.sign(normal.sum()), round(width / bristles) + 2
    for position in np.linspace(-0.5, 0.5, bristles):
        relief = 1 + 0.3 * position * side + rng.normal(0, 0.09)
        first, left_out = rng.integers(0, 2, 2).tolist()
        points = (line + position * width * normal)[first : len(line) - left_out]
        cv2.polylines(
            canvas,
            [(points * 16).round().astype(np.int32)[:, None]],
            isClosed=False,
            color=(color * relief).clip(0, 1).tolist(),
            thickness=breadth,
            lineType=cv2.LINE_AA,
            shift=4,
        )
