"""How steady a stylised trajectory is, pair by pair, by three measures with their floors.

Along the flow of the unstylised frames as in the paper (`flow_consistency`), along the field's own
depth (`geometric_consistency`), and as it looks (`perceptual_distance`); beside them how much of
the style the frames have, since a grey video is the steadiest.
"""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from styletrf.errors import InputError
from styletrf.evaluation.flow import FlowEstimator, Method
from styletrf.evaluation.flow_consistency import FlowErrors, flow_errors
from styletrf.evaluation.frame_pairs import Frame, Pair, paired
from styletrf.evaluation.geometric_consistency import (
    Correspondence,
    GeometricErrors,
    corresponding,
    geometric_errors,
)
from styletrf.evaluation.metrics import Image
from styletrf.evaluation.perceptual_distance import (
    Grams,
    Perception,
    grams,
    masked_distances,
    style_distance,
)
from styletrf.finiteness import require_finite
from styletrf.progress import Progress, silent
from styletrf.style.perceptual.vgg import REDUCTION

SHORT_TERM, LONG_TERM, LONG_TERM_OF_THE_FIELD = 1, 5, 7
_OF_FLOW = ("error", "floor")
_OF_STYLE = ("style_distance", "style_distance_unstylized")
"""Finite in every pair that has them; others are NaN where nothing is seen in both frames."""


@dataclass(frozen=True, slots=True)
class ConsistencyConfig:
    """Which frames are compared, and how.

    Attributes:
        method: The flow, see `styletrf.evaluation.flow`.
        deltas: Frames between the two of a pair.
        depth_deltas: The same for pairs that are compared along the depth alone; 7 is what the
            papers since StyleTRF call long term.
        pairs: The most pairs of a delta, spread evenly over the trajectory.
        perceptual_pairs: The most of these that go through the perceptual network.
        tolerance: Fraction of the depth, beyond which a place counts as hidden.
        perceptual_px: The longer side at which frames go through the perceptual network.
    """

    method: Method = "dis"
    deltas: tuple[int, ...] = (SHORT_TERM, LONG_TERM)
    depth_deltas: tuple[int, ...] = (LONG_TERM_OF_THE_FIELD,)
    pairs: int = 12
    perceptual_pairs: int = 4
    tolerance: float = 0.02
    perceptual_px: int = 192

    def __post_init__(self) -> None:
        if not self.deltas or min(self.deltas) < 1:
            raise ValueError(f"deltas are {self.deltas}, not distances from 1")
        if min(self.depth_deltas, default=1) < 1:
            raise ValueError(f"depth_deltas are {self.depth_deltas}, not distances from 1")
        if min(self.pairs, self.perceptual_pairs) < 1:
            raise ValueError("pairs and perceptual_pairs are at least 1")
        if self.tolerance <= 0 or self.perceptual_px < REDUCTION:
            raise ValueError(f"tolerance is above 0, perceptual_px at least {REDUCTION}")


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
    """The pairs, and their means: `summary["delta_1"]["error"]` is the paper's short term error.

    A pair is a row of `first`, `second` (indices of frames), `delta`, and the attributes of
    `FlowErrors`, `GeometricErrors` and `PerceptualErrors`, NaN where a pair was not compared so. An
    entry of the summary has the means of these, null where there is nothing to average; `pairs` and
    `perceptual_pairs`, their numbers; and those that a mean leaves out: `pairs_without_flow` (no
    pixel returns to itself), `pairs_without_correspondence` (nothing is seen in both frames) and
    `pairs_without_contrast` (the scene has no detail there). An entry of `depth_deltas` has the
    attributes of `GeometricErrors` alone.
    """

    pairs: list[dict[str, Any]]
    summary: dict[str, dict[str, Any]]


def measure_consistency(
    frames: Iterable[Frame],
    n_frames: int,
    painting: Image,
    perception: Perception,
    config: ConsistencyConfig,
    progress: Progress = silent,
    cuts: Sequence[int] = (),
) -> Consistency:
    """Returns the consistency of the stylised frames by pairs spread over the trajectory.

    Frames are taken when their turn comes; those are kept that later ones are compared with.

    Args:
        frames: Along the trajectory, all of one size.
        n_frames: How many there are.
        painting: The style image, in [0, 1].
        perception: What looks at them.
        config: What is compared.
        progress: Called after every pair.
        cuts: The frames at which another still begins; no pair goes across one.

    Raises:
        InputError: A frame differs in size, or there are too few for any of the deltas.
        NotFiniteError: A frame is not, the flow between two, or a figure that every pair has.
    """
    planned = planned_pairs(n_frames, config, cuts)
    _require_pairs(planned, n_frames, config.deltas)
    comparison = _Comparison(perception, grams(perception.features(painting)), config)
    rows: list[dict[str, Any]] = []
    for pair, a, b in paired(frames, planned):
        compared = comparison(pair, a, b)
        named = (_OF_FLOW if pair.has_flow else ()) + (_OF_STYLE if pair.has_looks else ())
        figures = [(name, np.array(compared[name])) for name in named]
        require_finite("consistency", f"from frame {pair.first} to {pair.second}", figures)
        rows.append({"first": pair.first, "second": pair.second, "delta": pair.delta} | compared)
        error = _mean([row["error"] for row in rows if row["flow"]])
        progress(len(rows), len(planned), consistency_error=error or 0.0)
    rows.sort(key=lambda row: (row["delta"], row["first"]))
    deltas = sorted({*config.deltas, *(pair.delta for pair in planned)})
    return Consistency(rows, {f"delta_{d}": _summary(rows, planned, d) for d in deltas})


def planned_pairs(n_frames: int, config: ConsistencyConfig, cuts: Sequence[int] = ()) -> list[Pair]:
    """Returns the pairs to compare, in the order of their second frames.

    Of each delta `config.pairs`, spread evenly from the first to the last frame, or all; of these
    in turn `config.perceptual_pairs` go through the perceptual network. Frames before and after
    one of the `cuts`, at which another still begins, are no pair.
    """
    planned = []
    for delta in {*config.deltas, *config.depth_deltas}:
        has_flow = delta in config.deltas
        within = [
            k for k in range(n_frames - delta) if not any(k < cut <= k + delta for cut in cuts)
        ]
        firsts = _spread(within, config.pairs)
        looked_at = _spread(firsts, config.perceptual_pairs) if has_flow else []
        planned += [Pair(k, k + delta, delta, has_flow, k in looked_at) for k in firsts]
    return sorted(planned, key=lambda pair: (pair.second, pair.delta))


def _spread(values: Sequence[int], count: int) -> list[int]:
    if not values:
        return []
    at = np.unique(np.linspace(0, len(values) - 1, count).round().astype(int))
    return [values[k] for k in at]


class _Comparison:
    """Compares two frames by every measure."""

    def __init__(self, perception: Perception, painting: Grams, config: ConsistencyConfig) -> None:
        self._perception, self._painting = perception, painting
        self._estimator = FlowEstimator(config.method, perception.device)
        self._tolerance = config.tolerance

    def __call__(self, pair: Pair, a: Frame, b: Frame) -> dict[str, Any]:
        """Returns the measures of a pair."""
        plain = a.unstylized.color, b.unstylized.color
        along_flow = (
            flow_errors(plain, (a.stylized, b.stylized), self._estimator)
            if pair.has_flow
            else _NO_FLOW
        )
        depths = a.unstylized.depth, b.unstylized.depth
        cameras = a.camera, b.camera
        warped = corresponding(cameras, depths, plain[1], b.stylized, self._tolerance)
        along_depth = geometric_errors(plain[0], a.stylized, warped)
        looks = self._looks(a, warped) if pair.has_looks else _NO_LOOKS
        return asdict(along_flow) | asdict(along_depth) | asdict(looks)

    def _looks(self, a: Frame, warped: Correspondence) -> PerceptualErrors:
        """Looks at the first frame and at the second one warped into it."""
        images = a.unstylized.color, a.stylized
        features = self._perception.features_of(images)
        others = warped.unstylized, warped.stylized
        floor, error = masked_distances(self._perception, images, features, others, warped.seen)
        plain, styled = (style_distance(grams(found), self._painting) for found in features)
        return PerceptualErrors(error, floor, styled, plain)


_NO_FLOW = FlowErrors("", *[math.nan] * 5)
_NO_LOOKS = PerceptualErrors(*[math.nan] * 4)


def _summary(
    rows: Sequence[Mapping[str, Any]], planned: Collection[Pair], delta: int
) -> dict[str, Any]:
    chosen = [row for row in rows if row["delta"] == delta]
    kinds = [pair for pair in planned if pair.delta == delta]
    counts: dict[str, Any] = {
        "pairs": len(chosen),
        "pairs_without_correspondence": sum(row["geometric_fraction"] == 0 for row in chosen),
        "pairs_without_contrast": sum(
            row["geometric_fraction"] > 0 and math.isnan(row["normalized_error"]) for row in chosen
        ),
    }
    names = [field.name for field in fields(GeometricErrors)]
    if all(pair.has_flow for pair in kinds):
        names += [field.name for kind in (FlowErrors, PerceptualErrors) for field in fields(kind)]
        names.remove("flow")
        counts |= {
            "pairs_without_flow": sum(row["valid_fraction"] == 0 for row in chosen),
            "perceptual_pairs": sum(pair.has_looks for pair in kinds),
            "flow": rows[0]["flow"],
        }
    return counts | {name: _mean([row[name] for row in chosen]) for name in names}


def _mean(values: Sequence[float]) -> float | None:
    defined = [value for value in values if not math.isnan(value)]
    return float(np.mean(defined)) if defined else None


def _require_pairs(planned: Collection[Pair], n_frames: int, deltas: Sequence[int]) -> None:
    if not any(pair.has_flow for pair in planned):
        raise InputError(
            f"trajectory of {n_frames} frames",
            f"has no pair of frames {' or '.join(map(str, deltas))} apart",
            "Render more frames, or measure smaller distances",
        )
