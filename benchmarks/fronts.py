"""`python benchmarks/fronts.py FRONT.json FRONT.json --to FILE`: one front of two qualities.

Each is the `front.json` of `TradeOff` of one scene and one painting, around another quality. Both
have photographs of one size, so that their PSNR compare. Each variant of the scene in a front is
combined with each of the style, because a combination that was beaten in its front may not be in
the joined one. The points get the quality that they change, the seconds of the machine and the day
of the lower quality's sweep, and the shortfall from the best of both. The points are left out that
a faster one beats.
"""

import argparse
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from styletrf.evaluation.trade_off import FOLLOWING_FRAMES, Combination, Tuning, merged
from tasks.machine.calibration import Calibration
from tasks.presets.presets import PRESETS
from tasks.presets.quality_choice import by_quality
from tasks.summary.trade_off_measurements import SCENE

SAME = ("scene", "style", "space", "photographs")


def combined(scene: Combination, style: Combination) -> Combination:
    """Returns the variant of the scene of one point with that of the style of another.

    Stages that render the field take as many times longer as the scene's frames do. The bytes are
    those of the first point.
    """
    frames = "TrajectoryFrames"
    ratio = scene.stage_seconds[frames] / style.stage_seconds[frames]
    of_style = {
        stage: seconds * (ratio if stage in FOLLOWING_FRAMES else 1.0)
        for stage, seconds in style.stage_seconds.items()
        if stage not in SCENE
    }
    of_scene = {k: v for k, v in scene.stage_seconds.items() if k in SCENE}
    seconds = {**of_style, **of_scene}
    both = (scene, style)
    return replace(
        style,
        scene=scene.scene,
        tuning=merged(_part(scene.tuning, of_scene=True), _part(style.tuning, of_scene=False)),
        psnr_db=scene.psnr_db,
        stage_seconds=seconds,
        seconds=sum(seconds.values()),
        seconds_spread=max(p.seconds_spread or 0.0 for p in both) or None,
        other_cpu_share=max(p.other_cpu_share or 0.0 for p in both),
        peak_memory_bytes=max(p.peak_memory_bytes for p in both),
        model_bytes=scene.model_bytes,
    )


def _part(tuning: Tuning, *, of_scene: bool) -> Tuning:
    return {stage: values for stage, values in tuning.items() if (stage in SCENE) == of_scene}


def variants_combined(points: Sequence[Combination]) -> Iterator[Combination]:
    """Yields each variant of the scene with each of the style; points stay as they are."""
    known = {(point.scene, point.style): point for point in points}
    scenes, styles = ({getattr(p, side): p for p in points} for side in ("scene", "style"))
    for scene in scenes.values():
        for style in styles.values():
            yield known.get((scene.scene, style.style)) or combined(scene, style)


def moved(front: dict[str, Any], calibration: Calibration) -> Iterator[Combination]:
    """Yields the combinations of a front with their quality, in the seconds of a calibration."""
    measured = Calibration.from_json(front["calibration"])
    points = [Combination(**each["combination"]) for each in front["points"]]
    for point in variants_combined(points):
        seconds = {
            stage: calibration.times_slower_than(measured, stage) * seconds
            for stage, seconds in point.stage_seconds.items()
        }
        total = sum(seconds.values())
        spread = point.seconds_spread and point.seconds_spread * total / point.seconds
        quality = point.quality or front["quality"]
        yield replace(
            point, stage_seconds=seconds, seconds=total, seconds_spread=spread, quality=quality
        )


def unbeaten(points: Sequence[Combination]) -> list[Combination]:
    """Returns the points that a bound on time or quality may choose, the fastest first.

    Each is better than all faster ones, or than those without another stylizer if it has none:
    commands that decide the stylizer choose among these.
    """
    kept: list[Combination] = []
    best = {True: (math.inf, math.inf), False: (math.inf, math.inf)}
    for point in sorted(points, key=lambda point: (point.seconds, by_quality(point))):
        has_other = bool(point.stylizer)
        if by_quality(point) < best[has_other]:
            kept.append(point)
            best[True] = min(best[True], by_quality(point))
            best[False] = best[False] if has_other else by_quality(point)
    return kept


def joined(fronts: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Returns the front of the points of two fronts.

    Raises:
        ValueError: The fronts are not of one scene and one painting.
    """
    first, second = sorted(fronts, key=lambda front: PRESETS.index(front["quality"]))
    if unlike := [name for name in SAME if first[name] != second[name]]:
        raise ValueError(f"the fronts differ in {', '.join(unlike)}")
    calibration = Calibration.from_json(first["calibration"])
    points = [point for front in (first, second) for point in moved(front, calibration)]
    psnr_db, style_db = (max(getattr(p, n) for p in points) for n in ("psnr_db", "style_db"))
    points = [
        replace(p, shortfall_db=max(psnr_db - p.psnr_db, style_db - p.style_db)) for p in points
    ]
    changes = "; ".join(f"{front['changes']} of {front['quality']}" for front in (first, second))
    rows = [{"combination": asdict(point), "overlaps": None} for point in unbeaten(points)]
    return {**first, "changes": changes, "points": rows}


def main() -> None:
    """Joins two files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("fronts", nargs=2, type=Path)
    parser.add_argument("--to", type=Path, required=True)
    options = parser.parse_args()
    front = joined([json.loads(path.read_text()) for path in options.fronts])
    options.to.write_text(json.dumps(front, indent=1, sort_keys=True) + "\n")


if __name__ == "__main__":
    main()
