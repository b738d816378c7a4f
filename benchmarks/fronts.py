"""`python benchmarks/fronts.py FRONT.json FRONT.json --to FILE`: one front of two qualities.

Each is the `front.json` of `TradeOff` of one scene and one painting, around another quality. Both
have photographs of one size, so that their PSNR compare. The points get the quality that they
change, the seconds of the first one's machine on its day, and the shortfall from the best of both;
those that another point beats are left out.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from styletrf.evaluation.pareto_front import pareto_front
from styletrf.evaluation.trade_off import Combination
from tasks.machine.calibration import Calibration

SAME = ("scene", "style", "space", "photographs")


def on_the_machine_of(front: dict[str, Any], calibration: Calibration) -> list[Combination]:
    """Returns the points of a front with their quality, in the seconds of a calibration."""
    measured = Calibration.from_json(front["calibration"])

    def moved(point: Combination) -> Combination:
        seconds = {
            stage: calibration.times_slower_than(measured, stage) * seconds
            for stage, seconds in point.stage_seconds.items()
        }
        total, before = sum(seconds.values()), point.seconds
        spread = point.seconds_spread and point.seconds_spread * total / before
        quality = point.quality or front["quality"]
        return replace(
            point, stage_seconds=seconds, seconds=total, seconds_spread=spread, quality=quality
        )

    return [moved(Combination(**each["combination"])) for each in front["points"]]


def joined(fronts: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Returns the front of the points of two fronts.

    Raises:
        ValueError: The fronts are not of one scene and one painting.
    """
    first, second = fronts
    if unlike := [name for name in SAME if first[name] != second[name]]:
        raise ValueError(f"the fronts differ in {', '.join(unlike)}")
    calibration = Calibration.from_json(first["calibration"])
    points = [point for front in fronts for point in on_the_machine_of(front, calibration)]
    psnr_db, style_db = (max(getattr(p, n) for p in points) for n in ("psnr_db", "style_db"))
    points = [
        replace(p, shortfall_db=max(psnr_db - p.psnr_db, style_db - p.style_db)) for p in points
    ]
    best = [each.combination for each in pareto_front(points, ())]
    usual = [p.combination for p in pareto_front((p for p in points if not p.stylizer), ())]
    served = [*best, *(p for p in usual if p not in best)]
    changes = "; ".join(f"{front['changes']} of {front['quality']}" for front in fronts)
    rows = [{"combination": asdict(point), "overlaps": None} for point in served]
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
