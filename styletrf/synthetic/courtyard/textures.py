"""Albedo textures at many scales, none of which repeats: stone, brick, plaster, wood, leaf, glaze.

A texture is `height width 3` float32 linear albedo in [0, 1]; sizes are in meters.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int

TEXELS_PER_METER = 96

Texture = Float[np.ndarray, "height width 3"]
Gray = Float[np.ndarray, "height width"]
Size = tuple[float, float]  # meters along u and v


@dataclass(frozen=True, slots=True)
class Masonry:
    """Courses of stones; lengths in meters, colors as sRGB."""

    course: float
    length: float
    irregularity: float
    joint: float
    stones: tuple[str, ...]
    mortar: str
    contrast: float = 0.22


BRICK = Masonry(
    0.13, 0.30, 0.28, 0.014,
    ("#a8583c", "#8f4630", "#b96d48", "#7a3b2c", "#c58a5e", "#94503f", "#6d3a33"), "#c3b49b",
)  # fmt: skip
PAVING = Masonry(
    0.42, 0.55, 0.5, 0.018,
    ("#a59a86", "#8d8577", "#b8a98c", "#98907f", "#7f7d76", "#b29c7c", "#a28a72"), "#5d5648",
    0.28,
)  # fmt: skip
RUBBLE = Masonry(
    0.22, 0.34, 0.62, 0.024,
    ("#b09c78", "#8f8468", "#c6b088", "#9a8263", "#77705f", "#b88f63", "#a3977f"), "#8a7d66",
    0.3,
)  # fmt: skip


def albedo(color: str) -> Float[np.ndarray, " 3"]:
    """Returns the linear light of an sRGB color "#rrggbb"."""
    encoded = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def noise(size: Size, cell: float, rng: np.random.Generator, octaves: int = 4) -> Gray:
    """Returns smooth noise of about unit variance; `cell` is its largest scale in meters."""
    width, height = _texels(size)
    total = np.zeros((height, width), np.float32)
    for octave in range(octaves):
        cells = [max(2, round(2**octave * side / cell) + 2) for side in size]
        lattice = rng.standard_normal((cells[1], cells[0]), dtype=np.float32)
        total += 0.62**octave * cv2.resize(lattice, (width, height), interpolation=cv2.INTER_CUBIC)
    return total / np.float32(total.std() + 1e-6)


def masonry(size: Size, kind: Masonry, rng: np.random.Generator) -> Texture:
    """Returns courses of stones, each with a color, stains, worn edges and grain of its own."""
    width, height = _texels(size)
    v, u = np.mgrid[0:height, 0:width].astype(np.float32) / TEXELS_PER_METER
    u += 0.014 * noise(size, 0.12, rng)
    v += 0.012 * noise(size, 0.12, rng)
    stone, edge = _stones(u, v, size, kind, rng)
    count = int(stone.max()) + 1
    palette = np.stack([albedo(color) for color in kind.stones])
    colors = palette[rng.integers(len(palette), size=count)]
    colors = colors * np.exp(0.22 * rng.standard_normal((count, 1)))
    speckle = kind.contrast * (0.7 * noise(size, 0.25, rng, 5) + 0.6 * noise(size, 0.035, rng, 2))
    shade = np.exp(speckle + 0.16 * noise(size, 1.6, rng, 3) - 0.35 * np.exp(-edge / 0.016))
    face = colors[stone] * shade[..., None]
    mortar = albedo(kind.mortar) * np.exp(0.2 * noise(size, 0.05, rng, 2))[..., None]
    cover = np.clip((edge - kind.joint / 2) / 0.012 + 0.5, 0, 1)[..., None]
    return _texture(cover * face + (1 - cover) * mortar)


def _stones(
    u: Gray, v: Gray, size: Size, kind: Masonry, rng: np.random.Generator
) -> tuple[Int[np.ndarray, "height width"], Gray]:
    """Returns each texel's stone and its distance (meters) to the nearest joint."""
    courses = _joints(size[1], kind.course, kind.irregularity / 2, rng)
    row = np.clip(np.searchsorted(courses, v) - 1, 0, len(courses) - 2)
    edge = np.minimum(v - courses[row], courses[row + 1] - v)
    stone = np.zeros(u.shape, np.int64)
    first = 0
    for index in range(len(courses) - 1):
        joints = _joints(size[0], kind.length, kind.irregularity, rng)
        here = row == index
        column = np.clip(np.searchsorted(joints, u[here]) - 1, 0, len(joints) - 2)
        nearest = np.minimum(u[here] - joints[column], joints[column + 1] - u[here])
        edge[here] = np.minimum(edge[here], nearest)
        stone[here] = first + column
        first += len(joints)
    return stone, np.maximum(edge, 0)


def _joints(
    extent: float, step: float, irregularity: float, rng: np.random.Generator
) -> Float[np.ndarray, " joints"]:
    """Returns increasing positions from before 0 to beyond `extent`, about `step` apart."""
    count = int(extent / (step * (1 - 0.5 * irregularity))) + 4
    steps = step * (1 + irregularity * rng.uniform(-0.5, 0.5, count))
    return np.asarray(np.cumsum(steps) - step * (1 + rng.uniform(0, 1)))


def plaster(size: Size, color: str, rng: np.random.Generator, worn: float = 0.9) -> Texture:
    """Returns stained, cracked plaster; brick shows where noise exceeds `worn` deviations."""
    wall = masonry(size, BRICK, rng)
    v = np.linspace(0, 1, wall.shape[0])[:, None]
    stain = 0.13 * noise(size, 1.1, rng, 6) + 0.07 * noise(size, 0.06, rng, 2)
    damp = -0.5 * np.clip(v - 0.72 + 0.06 * noise(size, 0.5, rng), 0, 1)
    cracks = -0.75 * np.exp(-((noise(size, 0.8, rng, 5) / 0.022) ** 2))
    scratches = -0.3 * (noise((size[0], size[1] / 7), 0.12, rng, 3) > 1.9).astype(np.float32)
    streaks = cv2.resize(scratches, (wall.shape[1], wall.shape[0]))
    smooth = albedo(color) * np.exp(stain + damp + cracks + streaks)[..., None]
    hole = noise(size, 1.3, rng, 5) + 0.8 * (v - 0.5)
    cover = np.clip((worn - hole) / 0.06, 0, 1)[..., None]
    rim = np.exp(-0.5 * np.exp(-(((hole - worn) / 0.07) ** 2)))[..., None]
    return _texture((cover * smooth + (1 - cover) * wall) * rim)


def wood(size: Size, color: str, plank: float, rng: np.random.Generator) -> Texture:
    """Returns planks along v with grain and knots; `plank` is their width in meters."""
    width, height = _texels(size)
    u = np.broadcast_to(np.arange(width) / TEXELS_PER_METER, (height, width))
    joints = _joints(size[0], plank, 0.15, rng)
    index = np.clip(np.searchsorted(joints, u) - 1, 0, len(joints) - 2)
    edge = np.minimum(u - joints[index], joints[index + 1] - u)
    tint = np.exp(0.25 * rng.standard_normal(len(joints)))[index]
    stretched = noise((size[0], size[1] / 12), 0.03, rng, 3)
    grain = cv2.resize(stretched, (width, height), interpolation=cv2.INTER_CUBIC)
    knots = np.exp(-((noise(size, 0.35, rng, 3) - 2.0) ** 2) / 0.05)
    tone = 0.24 * grain + 0.12 * noise(size, 0.3, rng, 4) - 0.8 * knots
    shade = tint * np.exp(tone) * np.clip(edge / 0.01, 0.15, 1)
    return _texture(albedo(color) * shade[..., None])


def earthenware(size: Size, color: str, rng: np.random.Generator) -> Texture:
    """Returns speckled stone or fired clay, for pots, tiles and the pedestal."""
    tone = 0.2 * noise(size, 0.3, rng, 5) + 0.16 * noise(size, 0.03, rng, 2)
    cracks = -0.4 * np.exp(-((noise(size, 0.4, rng, 4) / 0.03) ** 2))
    return _texture(albedo(color) * np.exp(tone + cracks)[..., None])


def metal(size: Size, color: str, rng: np.random.Generator) -> Texture:
    """Returns painted iron with some rust."""
    rust = np.clip(noise(size, 0.2, rng, 4) - 0.9, 0, 1)[..., None]
    paint = albedo(color) * np.exp(0.15 * noise(size, 0.05, rng, 2))[..., None]
    return _texture((1 - rust) * paint + rust * albedo("#7a4a2c"))


def foliage(color: str, rng: np.random.Generator) -> Texture:
    """Returns one leaf: pale midrib and side veins, u across it and v along it."""
    size = (64 / TEXELS_PER_METER, 64 / TEXELS_PER_METER)
    v, u = np.mgrid[0:64, 0:64] / 63.0
    across = np.abs(u - 0.5)
    ribs = np.exp(-((across / 0.025) ** 2))
    veins = 0.5 * np.exp(-(((np.sin(2 * np.pi * 5 * (v - 0.8 * across))) / 0.2) ** 2))
    tone = 0.12 * noise(size, 0.25, rng) - 0.5 * across
    blade = albedo(color) * np.exp(tone + 0.35 * np.maximum(ribs, veins))[..., None]
    return _texture(blade)


def glaze(rng: np.random.Generator) -> Texture:
    """Returns the vase's glaze: u around it, v from lip to foot, ochre bands and leaves on blue."""
    size = (3.0, 1.4)
    width, height = _texels(size)
    v, u = np.mgrid[0:height, 0:width] / np.array([height, width])[:, None, None]
    wave = np.sin(2 * np.pi * 9 * u)
    petals = np.abs(v - 0.47 - 0.07 * wave) < 0.022 + 0.014 * np.cos(2 * np.pi * 18 * u)
    dots = (np.cos(2 * np.pi * 18 * u) * np.cos(2 * np.pi * 14 * (v - 0.47)) > 0.72) & (
        np.abs(v - 0.47) < 0.18
    )
    bands = sum(np.abs(v - at) < half for at, half in ((0.2, 0.012), (0.7, 0.012), (0.76, 0.02)))
    tone = np.exp(0.25 * noise(size, 0.5, rng, 5) + 0.5 * (0.5 - v))[..., None]
    base = np.where((v < 0.13)[..., None], albedo("#2b6f6a"), albedo("#1f4d86")) * tone
    ochre = albedo("#d9a441") * np.exp(0.1 * noise(size, 0.1, rng))[..., None]
    painted = np.where((petals | (bands > 0))[..., None], ochre, base)
    return _texture(np.where((dots & ~petals)[..., None], albedo("#e8e2cf"), painted))


def _texels(size: Size) -> tuple[int, int]:
    return max(2, round(size[0] * TEXELS_PER_METER)), max(2, round(size[1] * TEXELS_PER_METER))


def _texture(color: Float[np.ndarray, "height width 3"]) -> Texture:
    return np.asarray(np.clip(color, 0.008, 0.92), dtype=np.float32)
