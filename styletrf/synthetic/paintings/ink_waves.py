"""Waves in ink on paper."""

import numpy as np

from styletrf.synthetic.paintings.canvas import (
    FINE,
    Canvas,
    Color,
    Field,
    Painting,
    coordinates,
    finished,
    noise,
    rgb,
)


def ink_waves(seed: int = 0) -> Painting:
    """Returns rolling waves in indigo ink on paper under a vermilion sun."""
    rng = np.random.default_rng([seed, 3])
    x, y = coordinates()
    paper = rgb("#f3e6c8") * (1 + 0.035 * noise(30, rng) + 0.025 * noise(4, rng))[..., None]
    sky = np.clip(1 - y / 0.5, 0, 1)[..., None] ** 1.5
    canvas = paper * (1 - 0.35 * sky) + 0.35 * sky * rgb("#d9a05b")
    from_sun = np.hypot(x - 0.66, y - 0.27) + 0.003 * noise(110, rng)
    turn = (from_sun - 0.155) / 0.036
    haze = np.where((np.floor(turn) % 2 < 1)[..., None], rgb("#eeb765"), rgb("#e58f4f"))
    canvas = np.where((turn > 0)[..., None], 0.45 * canvas + 0.55 * haze, canvas)
    ring = np.clip((0.06 + 0.05 * noise(80, rng) - np.abs(turn - np.rint(turn))) * 18, 0, 1)
    ring = (ring * (turn > 0.5))[..., None]
    canvas = (1 - ring) * canvas + ring * rgb("#6b2b25")
    sun = np.clip((0.15 - from_sun) * FINE / 2, 0, 1)[..., None]
    canvas = (1 - sun) * canvas + sun * rgb("#d8391f") * (1 + 0.06 * noise(16, rng))[..., None]
    inks = "#8fb6c9 #5f97b8 #3c77a6 #28598f #1c4279 #163061 #101f45"
    shades = [rgb(name) for name in inks.split()]
    for row, base in enumerate(np.linspace(0.34, 1.02, 10)):
        shade = shades[min(row, len(shades) - 1)]
        _wave(canvas, x, y, base, 0.055 + 0.006 * row, shade, rng)
    return finished(canvas)


def _wave(
    canvas: Canvas, x: Field, y: Field, base: float, height: float, shade: Color,
    rng: np.random.Generator,
) -> None:  # fmt: skip
    """Paints one row of waves over those behind it: foam, outline, lines below the crest."""
    count, phase = rng.integers(3, 6), rng.uniform(0, 1)
    rough = 0.004 * noise(50, rng)
    first = max(0, int(FINE * (base - height - rough.max())) - 2)  # no crest reaches the rows above
    x, y, rough, canvas = (each[first:] for each in (x, y, rough, canvas))
    turns = count * (x + 0.045 * np.sin(2 * np.pi * (1.3 * x + phase))) + phase
    curl = turns + 0.16 * np.sin(2 * np.pi * turns) * np.clip((base - y) / height + 0.6, 0, 1)
    crest = np.abs(np.sin(np.pi * curl)) ** 1.35
    below = y - (base - height * crest) + rough
    depth = np.clip(below / (2.6 * height), 0, 1)
    lines = 0.5 + 0.5 * np.cos(2 * np.pi * below / 0.0165)
    width = 0.42 + 0.3 * np.sin(np.pi * curl) ** 2 - 0.25 * depth
    inked = np.clip((lines - 1 + width) * 7, 0, 1)[..., None]
    body = shade * (1.25 - 0.45 * depth)[..., None]
    paint = inked * body * 0.55 + (1 - inked) * (0.75 * body + 0.25 * rgb("#dfe8dd"))
    fringe = 0.012 + 0.02 * crest**3 + 0.008 * np.sin(2 * np.pi * turns * 11) * crest
    foam = np.clip((fringe - below) * FINE / 3, 0, 1)[..., None]
    paint = (1 - foam) * paint + foam * rgb("#f8f1dc")
    for edge, thick in ((0.0 * below, 0.0042), (fringe, 0.0026)):
        ink = np.clip((thick - np.abs(below - edge)) * FINE / 2, 0, 1)[..., None]
        paint = (1 - ink) * paint + ink * rgb("#0e1a38")
    cover = np.clip(below * FINE / 2 + 0.5, 0, 1)[..., None]
    canvas[:] = (1 - cover) * canvas + cover * paint
