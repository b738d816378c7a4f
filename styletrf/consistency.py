"""How steady a stylised trajectory is, pair by pair, by three measures with their floors.

Along the flow of the unstylised frames as in the paper (`flow_consistency`), along the field's own
depth (`geometric_consistency`), and as it looks (`perceptual_distance`); beside them how much of
the style the frames have, since a grey video is the steadiest.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from styletrf.cameras import Camera
from styletrf.errors import InputError
from styletrf.finiteness import require_finite
from styletrf.float_images import FloatImage, read_float_image
from styletrf.flow import FlowEstimator, Method
from styletrf.flow_consistency import flow_errors
from styletrf.geometric_consistency import corresponding, geometric_errors
from styletrf.images import read_rgb
from styletrf.metrics import Image
from styletrf.perceptual_distance import (
    Features,
    Grams,
    Perception,
    grams,
    masked_distances,
    style_distance,
)
from styletrf.progress import Progress, silent
from styletrf.vgg import REDUCTION

SHORT_TERM, LONG_TERM = 1, 5
_ALWAYS_TOLD = ("error", "floor", "style_distance", "style_distance_unstylized")
"""The others are NaN where nothing is seen in both frames."""


@dataclass(frozen=True, slots=True)
class ConsistencyConfig:
    """Which frames are compared, and how.

    Attributes:
        method: The flow, see `styletrf.flow`.
        deltas: Frames between the two of a pair.
        tolerance: Fraction of the depth, beyond which a place counts as hidden.
        perceptual_px: The longer side at which frames go through the perceptual network.
    """

    method: Method = "dis"
    deltas: tuple[int, ...] = (SHORT_TERM, LONG_TERM)
    tolerance: float = 0.02
    perceptual_px: int = 192

    def __post_init__(self) -> None:
        if not self.deltas or min(self.deltas) < 1:
            raise ValueError(f"deltas are {self.deltas}, not distances from 1")
        if self.tolerance <= 0 or self.perceptual_px < REDUCTION:
            raise ValueError(f"tolerance is above 0, perceptual_px at least {REDUCTION}")


@dataclass(frozen=True, slots=True)
class Frame:
    """One view of the trajectory, without and with style."""

    camera: Camera
    unstylized: FloatImage
    stylized: Image


@dataclass(frozen=True, slots=True)
class PerceptualErrors:
    """Two frames compared as they look, where the second one sees what the first one does.

    Attributes:
        perceptual_error: Perceptual distance of the stylised frames; NaN where nothing is seen.
        perceptual_floor: The same of the unstylised frames.
        style_distance: From the first stylised frame to the painting, by Gram matrices.
        style_distance_unstylized: From the first unstylised frame to the painting.
    """

    perceptual_error: float
    perceptual_floor: float
    style_distance: float
    style_distance_unstylized: float


@dataclass(frozen=True, slots=True)
class Consistency:
    """All pairs, and their means: `summary["delta_1"]["error"]` is the paper's short term error.

    A pair is a row of `first`, `second` (indices of frames), `delta`, and the attributes of
    `FlowErrors`, `GeometricErrors` and `PerceptualErrors`. An entry of the summary has the means of
    these, null where there is nothing to average; `pairs`, their number; and those that a mean
    leaves out: `pairs_without_flow` (no pixel returns to itself), `pairs_without_correspondence`
    (nothing is seen in both frames) and `pairs_without_contrast` (the scene has no detail there).
    """

    pairs: list[dict[str, Any]]
    summary: dict[str, dict[str, Any]]


def read_frame(unstylized: Path, stylized: Path, camera: Camera) -> Frame:
    """Returns the frame `frames/NAME.exr` and `frames/NAME.png` of two folders."""
    plain = read_float_image(unstylized / "frames" / f"{camera.name}.exr")
    return Frame(camera, plain, read_rgb(stylized / "frames" / f"{camera.name}.png"))


def measure_consistency(
    frames: Iterable[Frame],
    n_frames: int,
    painting: Image,
    perception: Perception,
    config: ConsistencyConfig,
    progress: Progress = silent,
) -> Consistency:
    """Returns the consistency of the stylised frames for every pair.

    Frames are taken when their turn comes; at most `max(deltas) + 1` are in memory.

    Args:
        frames: Along the trajectory, all of one size.
        n_frames: How many there are.
        painting: The style image, in [0, 1].
        perception: What looks at them.
        config: What is compared.
        progress: Told after every pair.

    Raises:
        InputError: A frame differs in size, or there are too few for any of the deltas.
        NotFiniteError: A frame is not, the flow between two, or a figure that every pair has.
    """
    _require_pairs(n_frames, config.deltas)
    total = sum(max(0, n_frames - delta) for delta in config.deltas)
    comparison = _Comparison(perception, config)
    looks = _Looks(perception, grams(perception.features(painting)))
    rows: list[dict[str, Any]] = []
    for first, second, a, b in _pairs(frames, looks, config.deltas):
        compared = comparison(a, b)
        told = [(name, np.array(compared[name])) for name in _ALWAYS_TOLD]
        require_finite("consistency", f"from frame {first} to {second}", told)
        rows.append({"first": first, "second": second, "delta": second - first} | compared)
        progress(len(rows), total, consistency_error=sum(r["error"] for r in rows) / len(rows))
    rows.sort(key=lambda row: (row["delta"], row["first"]))
    return Consistency(rows, {f"delta_{delta}": _summary(rows, delta) for delta in config.deltas})


@dataclass(frozen=True, slots=True)
class _Seen:
    """A frame, what the perceptual network sees of it, and how far that is from the painting.

    Without style first, with it second.
    """

    frame: Frame
    features: tuple[Features, Features]
    style_distances: tuple[float, float]


@dataclass(frozen=True, slots=True)
class _Looks:
    """Looks at frames."""

    perception: Perception
    painting: Grams

    def __call__(self, frame: Frame) -> _Seen:
        plain, styled = self.perception.features_of([frame.unstylized.color, frame.stylized])
        far = [style_distance(grams(found), self.painting) for found in (plain, styled)]
        return _Seen(frame, (plain, styled), (far[0], far[1]))


def _pairs(
    frames: Iterable[Frame], look: _Looks, deltas: Sequence[int]
) -> Iterator[tuple[int, int, _Seen, _Seen]]:
    window: dict[int, _Seen] = {}
    for second, frame in enumerate(frames):
        before = window[second - 1].frame if second else frame
        _require_one_size(second, frame, before)
        images = [("unstylised", frame.unstylized.color), ("stylised", frame.stylized)]
        require_finite("consistency", f"in frame {frame.camera.name}", images)
        window[second] = look(frame)
        for delta in deltas:
            if second >= delta:
                yield second - delta, second, window[second - delta], window[second]
        window.pop(second - max(deltas), None)


class _Comparison:
    """Compares two frames by every measure."""

    def __init__(self, perception: Perception, config: ConsistencyConfig) -> None:
        self._perception = perception
        self._estimator = FlowEstimator(config.method, perception.device)
        self._tolerance = config.tolerance

    def __call__(self, a: _Seen, b: _Seen) -> dict[str, Any]:
        """Returns the row of a pair."""
        one, other = a.frame, b.frame
        plain = one.unstylized.color, other.unstylized.color
        along_flow = flow_errors(plain, (one.stylized, other.stylized), self._estimator)
        depths = one.unstylized.depth, other.unstylized.depth
        cameras = one.camera, other.camera
        warped = corresponding(cameras, depths, plain[1], other.stylized, self._tolerance)
        along_depth = geometric_errors(plain[0], one.stylized, warped)
        floor, error = masked_distances(
            self._perception,
            (plain[0], one.stylized),
            a.features,
            (warped.unstylized, warped.stylized),
            warped.seen,
        )
        looks = PerceptualErrors(error, floor, a.style_distances[1], a.style_distances[0])
        return asdict(along_flow) | asdict(along_depth) | asdict(looks)


def _summary(rows: Sequence[Mapping[str, Any]], delta: int) -> dict[str, Any]:
    chosen = [row for row in rows if row["delta"] == delta]
    names = [name for name in rows[0] if isinstance(rows[0][name], float)]
    counts = {
        "pairs": len(chosen),
        "pairs_without_flow": sum(row["valid_fraction"] == 0 for row in chosen),
        "pairs_without_correspondence": sum(row["geometric_fraction"] == 0 for row in chosen),
        "pairs_without_contrast": sum(
            row["geometric_fraction"] > 0 and math.isnan(row["normalized_error"]) for row in chosen
        ),
        "flow": rows[0]["flow"],
    }
    return counts | {name: _mean([row[name] for row in chosen]) for name in names}


def _mean(values: Sequence[float]) -> float | None:
    defined = [value for value in values if not math.isnan(value)]
    return float(np.mean(defined)) if defined else None


def _require_pairs(n_frames: int, deltas: Sequence[int]) -> None:
    if n_frames <= min(deltas):
        raise InputError(
            f"trajectory of {n_frames} frames",
            f"has no pair of frames {' or '.join(map(str, deltas))} apart",
            "Render more frames, or measure smaller distances",
        )


def _require_one_size(index: int, frame: Frame, before: Frame) -> None:
    images = frame.unstylized.color, frame.stylized, before.stylized
    sizes = {image.shape[:2] for image in images}
    if len(sizes) > 1:
        listed = " and ".join(f"{width}x{height}" for height, width in sorted(sizes))
        raise InputError(
            f"frame {index}", f"mixes sizes of {listed} pixels", "Render all frames at one size"
        )
