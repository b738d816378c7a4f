"""Measures how consistent a stylized trajectory is, pair by pair, by three errors and their floors.

The errors are along the flow of the unstylized frames as in the paper (`flow_consistency`), along
the field's own depth (`geometric_consistency`), and in the look of frames (`perceptual_distance`).
Beside them stands how much of the style the frames have, since a gray video is the steadiest.
"""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from styletrf.errors import InputError
from styletrf.evaluation.consistency.flow_consistency import FlowErrors, flow_errors
from styletrf.evaluation.consistency.frame_pairs import Frame, Pair, paired, planned_pairs
from styletrf.evaluation.consistency.geometric_consistency import (
    Correspondence,
    GeometricErrors,
    OwnErrors,
    corresponding,
    geometric_errors,
)
from styletrf.evaluation.consistency.pair_plan import PairPlan
from styletrf.evaluation.flow import FlowEstimator, Method
from styletrf.evaluation.metrics import Image
from styletrf.evaluation.perceptual_distance import (
    Grams,
    PerceptualFeatures,
    grams,
    masked_distances,
    style_distance,
)
from styletrf.finiteness import require_finite
from styletrf.progress import Progress, silent
from styletrf.style.perceptual.vgg import REDUCTION

_OF_FLOW = ("error", "floor")
_OF_STYLE = ("style_distance", "style_distance_unstylized")
"""Finite in every pair that has them; others are NaN where nothing is seen in both frames."""


@dataclass(frozen=True, slots=True)
class ConsistencyConfig(PairPlan):
    """Which frames are compared, and how.

    Attributes:
        method: The flow, see `styletrf.evaluation.flow`.
        tolerance: Fraction of the depth, beyond which a place counts as hidden.
        perceptual_px: The longer side at which frames go through the perceptual network.
    """

    method: Method = "dis"
    tolerance: float = 0.02
    perceptual_px: int = 192

    def __post_init__(self) -> None:
        PairPlan.__post_init__(self)
        if self.tolerance <= 0 or self.perceptual_px < REDUCTION:
            raise ValueError(f"tolerance is above 0, perceptual_px at least {REDUCTION}")


@dataclass(frozen=True, slots=True)
class PerceptualErrors:
    """Two frames compared as they look, where both show the same surface.

    Attributes:
        perceptual_error: Perceptual distance of the stylized frames; NaN where nothing is seen.
        perceptual_floor: The same of the unstylized frames.
        style_distance: From the first stylized frame to the painting, by Gram matrices.
        style_distance_unstylized: From the first unstylized frame to the painting.
    """

    perceptual_error: float
    perceptual_floor: float
    style_distance: float
    style_distance_unstylized: float


@dataclass(frozen=True, slots=True)
class Consistency:
    """The pairs, and their means: `summary["delta_1"]["error"]` is the paper's short term error.

    A pair is a row of `first`, `second` (indices of frames), `delta`, and the attributes of
    `FlowErrors`, `GeometricErrors`, `OwnErrors` and `PerceptualErrors`, NaN where a pair was not
    compared so. An entry of the summary has the means of these, null where there is nothing to
    average; `pairs` and `perceptual_pairs`, their numbers; and those that a mean leaves out:
    `pairs_without_flow` (no pixel returns to itself), `pairs_without_correspondence` (nothing is
    seen in both frames) and `pairs_without_contrast` (the scene has no detail there). An entry of
    `depth_deltas` has the attributes of `GeometricErrors` alone. Where frames have depths of their
    own, the attributes of `OwnErrors` are there, and `pairs_without_own_correspondence`.
    """

    pairs: list[dict[str, Any]]
    summary: dict[str, dict[str, Any]]


def measure_consistency(
    frames: Iterable[Frame],
    n_frames: int,
    painting: Image,
    perception: PerceptualFeatures,
    config: ConsistencyConfig,
    progress: Progress = silent,
    cuts: Sequence[int] = (),
) -> Consistency:
    """Returns the consistency of the stylized frames by pairs spread over the trajectory.

    Frames are taken when their turn comes; those are kept that later ones are compared with.

    Args:
        frames: Along the trajectory, all of one size.
        n_frames: How many there are.
        painting: The style image, in [0, 1].
        perception: The features of VGG16 that compare them.
        config: Which frames are compared, and how.
        progress: Called after every pair.
        cuts: The frames at which another still begins; no pair goes across one.

    Raises:
        InputError: A frame differs in size, or there are too few for any of the deltas.
        NotFiniteError: A frame is not finite, or the flow between two, or a figure that every pair
            has.
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
    summary = {f"delta_{d}": _summary(rows, planned, d, config.method) for d in deltas}
    return Consistency(rows, summary)


class _Comparison:
    """Compares two frames by every measure."""

    def __init__(
        self, perception: PerceptualFeatures, painting: Grams, config: ConsistencyConfig
    ) -> None:
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
        along_own = self._along_own_depth(a, b)
        looks = self._looks(a, warped) if pair.has_looks else _NO_LOOKS
        return asdict(along_flow) | asdict(along_depth) | asdict(along_own) | asdict(looks)

    def _along_own_depth(self, a: Frame, b: Frame) -> OwnErrors:
        """Compares along the depth of the stylized field, where it has one of its own."""
        if a.own_depth is None or b.own_depth is None:
            return _NO_OWN_DEPTH
        depths, plain = (a.own_depth, b.own_depth), b.unstylized.color
        warped = corresponding((a.camera, b.camera), depths, plain, b.stylized, self._tolerance)
        found = geometric_errors(a.unstylized.color, a.stylized, warped)
        return OwnErrors(found.geometric_fraction, found.geometric_error, found.normalized_error)

    def _looks(self, a: Frame, warped: Correspondence) -> PerceptualErrors:
        """Compares the looks of the first frame and of the second one warped into it."""
        images = a.unstylized.color, a.stylized
        features = self._perception.features_of(images)
        others = warped.unstylized, warped.stylized
        floor, error = masked_distances(self._perception, images, features, others, warped.seen)
        plain, styled = (style_distance(grams(found), self._painting) for found in features)
        return PerceptualErrors(error, floor, styled, plain)


_NO_FLOW = FlowErrors("", *[math.nan] * 5)
_NO_OWN_DEPTH = OwnErrors(*[math.nan] * 3)
_NO_LOOKS = PerceptualErrors(*[math.nan] * 4)


def _summary(
    rows: Sequence[Mapping[str, Any]], planned: Collection[Pair], delta: int, method: Method
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
    if not all(math.isnan(row["own_fraction"]) for row in chosen):
        names += [field.name for field in fields(OwnErrors)]
        lost = sum(row["own_fraction"] == 0 for row in chosen)
        counts["pairs_without_own_correspondence"] = lost
    if all(pair.has_flow for pair in kinds):
        names += [field.name for kind in (FlowErrors, PerceptualErrors) for field in fields(kind)]
        names.remove("flow")
        counts |= {
            "pairs_without_flow": sum(row["valid_fraction"] == 0 for row in chosen),
            "perceptual_pairs": sum(pair.has_looks for pair in kinds),
            "flow": method,
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
