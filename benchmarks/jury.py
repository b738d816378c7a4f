"""Frames in folders, judged against their painting by measures that no training used."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.settings import data_root
from styletrf.capture.photographs import PHOTOGRAPH_SUFFIXES, natural_order
from styletrf.evaluation.metrics import Image
from styletrf.evaluation.resemblance.efficientnet_lite import load_efficientnet
from styletrf.evaluation.resemblance.frame_resemblance import (
    ResemblanceConfig,
    common_side_px,
    frame_resemblance,
    summary,
)
from styletrf.evaluation.resemblance.picture_traits import (
    PictureTraits,
    TraitMeter,
    nearest_painting,
    reduced,
)
from styletrf.even_spread import evenly_spread
from styletrf.files.float_images import read_float_image
from styletrf.files.images import read_rgb
from styletrf.style.perceptual.vgg import load_vgg
from styletrf.style.style_image import read_style_image

EMBEDDED = Path(__file__).parents[1] / "data" / "styles"
_ROTATIONS, _KNOTS, _SAMPLES = 20, 257, 20000  # of `with_colors_of`


@dataclass(frozen=True)
class Result:
    """The frames of a result in folders: with style, without, and the priors, if any."""

    name: str
    painting: Path
    stylized: Path
    unstylized: Path
    priors: Path | None = None

    def views(self, count: int) -> list[tuple[Image, Image]]:
        """Returns as many views, spread evenly, without and with style."""
        plain, painted = _files(self.unstylized), _files(self.stylized)
        if not plain.keys() & painted.keys() and len(plain) == len(painted):
            plain = dict(zip(painted, plain.values(), strict=True))
        shared = [name for name in painted if name in plain]
        if not shared:
            raise SystemExit(f"{self.stylized} and {self.unstylized} share no names of frames")
        return [(_read(plain[n]), _read(painted[n])) for n in evenly_spread(shared, count)]


class Jury:
    """Measures results, and looks for the nearest of all paintings."""

    def __init__(self, vgg: Path, config: ResemblanceConfig, *, retrieval: bool) -> None:
        """Loads both networks; the other paintings are looked at with the first frames."""
        self._meter = TraitMeter(load_vgg(vgg), load_efficientnet(), config.traits)
        self._config, self._retrieval = config, retrieval
        self._paintings: dict[tuple[int, ...], dict[str, PictureTraits]] = {}

    def rows(self, result: Result, *, baseline: bool) -> Iterator[dict[str, Any]]:
        """Yields the row of a result, and that of its unstylized frames recolored."""
        plain, painted = map(list, zip(*result.views(self._config.frames), strict=True))
        style = read_style_image(result.painting)
        priors = [_read(p) for p in _files(result.priors).values()] if result.priors else []
        side_px = common_side_px(plain[0], priors, self._config.traits)
        priors = [reduced(prior, side_px) for prior in priors]
        looked_at = [self._meter.of_frame(image, side_px) for image in plain]
        shown = {result.name: (painted, priors)}
        if baseline:
            shown[f"{result.name}, color map"] = (with_colors_of(style, plain), [])
        for name, (images, fitted_to) in shown.items():
            traits = self._meter.of_painting(style, plain[0])
            seen = [self._meter.of_frame(image, side_px) for image in images]
            rows = [
                frame_resemblance("", a, b, traits) for a, b in zip(looked_at, seen, strict=True)
            ]
            retrieved = self._retrieved(result.painting.stem, traits, seen, plain[0])
            yield {"result": name, **summary(rows, fitted_to), **retrieved}

    def _retrieved(
        self, own: str, style: PictureTraits, seen: Sequence[PictureTraits], frame: Image
    ) -> dict[str, float]:
        """Returns by measure the fraction of frames whose nearest painting is their own."""
        if not self._retrieval:
            return {}
        size = frame.shape[:2]
        if size not in self._paintings:
            self._paintings[size] = {
                name: self._meter.of_painting(read_style_image(path), frame)
                for name, path in all_paintings().items()
            }
        nearest = [nearest_painting(t, self._paintings[size] | {own: style}) for t in seen]
        measures = ("style_swd_patches", "sifid_vgg")
        return {f"own_{m}": float(np.mean([n[m] == own for n in nearest])) for m in measures}


def all_paintings() -> dict[str, Path]:
    """Returns the paintings of the data root and the embedded ones by name."""
    found = [p for root in (EMBEDDED, data_root() / "styles") for p in sorted(root.glob("[!.]*"))]
    return {path.stem: path for path in found if path.suffix.lower() in PHOTOGRAPH_SUFFIXES}


def with_colors_of(painting: Image, images: Sequence[Image]) -> list[Image]:
    """Returns images with the painting's histogram of colors: one map of colors, nothing painted.

    Iterative distribution transfer (Pitie et al. 2007): along the axes of random rotations one
    after another, quantiles are moved to the painting's.
    """
    rng, levels = np.random.default_rng(0), np.linspace(0, 1, _KNOTS)
    colors = np.concatenate([image.reshape(-1, 3) for image in images]).astype(np.float64)
    wanted = _sampled(painting.reshape(-1, 3).astype(np.float64), rng)
    at = rng.choice(len(colors), min(len(colors), _SAMPLES), replace=False)
    for _ in range(_ROTATIONS):
        axes, _ = np.linalg.qr(rng.standard_normal((3, 3)))
        turned = colors @ axes
        source, target = (
            np.quantile(turned[at], levels, axis=0),
            np.quantile(wanted @ axes, levels, axis=0),
        )
        moved = [np.interp(turned[:, k], source[:, k], target[:, k]) for k in range(3)]
        colors = np.stack(moved, axis=1) @ axes.T
    parts = np.split(colors, np.cumsum([image.size // 3 for image in images])[:-1])
    shaped = zip(parts, images, strict=True)
    return [np.clip(p.reshape(i.shape), 0, 1).astype(np.float32) for p, i in shaped]


def _sampled(colors: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return colors[rng.choice(len(colors), min(len(colors), _SAMPLES), replace=False)]


def _files(folder: Path) -> dict[str, Path]:
    found = [*folder.glob("*.exr"), *folder.glob("*.png")]
    return {path.stem: path for path in sorted(found, key=lambda path: natural_order(path.name))}


def _read(path: Path) -> Image:
    return read_float_image(path).color if path.suffix == ".exr" else read_rgb(path)
