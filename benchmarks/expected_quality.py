"""How well brief fits tell the PSNR of a whole one: `python benchmarks/expected_quality.py`.

    expected_quality.py fit horns fern fox --quality draft --to fits.jsonl
    expected_quality.py ratio fits.jsonl

`fit` adds a line for each scene: the PSNR of views set aside after fits of several fractions of the
iterations, and that of the views held out after the whole fit (`QualityMetrics`, from the store or
made there). `ratio` prints the ratio of gains that tells the latter best from each pair of brief
fits, and the errors: of all scenes, and of each with the ratio fitted to the others.
"""

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import luigi
import numpy as np
import torch
from task_of import task_of

from pipeline.task import artifact
from styletrf.configuration import configured
from styletrf.evaluation.expected_quality import brief_fits, extrapolated_psnr
from styletrf.field.kernels import kernels_for
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.scene.scene_model import SceneModelConfig
from styletrf.scene.training_photographs import model_of_photographs, read_training_photographs
from tasks import CameraPoses, QualityMetrics
from tasks.presets.presets import settings_for

FRACTIONS = (1 / 64, 1 / 32, 1 / 16, 1 / 8)
RATIOS = np.linspace(0.3, 0.95, 66)


def measured(scene: str, quality: str, fractions: Sequence[float]) -> dict[str, object]:
    """Returns the PSNR of the brief fits and of the whole one, and the seconds of the brief."""
    tasks = [task_of(kind, scene=scene, quality=quality) for kind in (CameraPoses, QualityMetrics)]
    if not luigi.build(tasks, local_scheduler=True, log_level="WARNING"):
        raise SystemExit(f"{scene} was not built")
    summary = json.loads((artifact(tasks[1]) / "summary.json").read_text())
    photographs = read_training_photographs(artifact(tasks[0]))
    config = configured(SceneModelConfig, settings_for("SceneModel", quality))
    model = model_of_photographs(photographs, config)
    settings = {"field.shading": model.shading, **settings_for("RadianceField", quality)}
    fit, cpu = configured(FieldTrainingConfig, settings), torch.device("cpu")
    started = time.monotonic()
    fits = brief_fits(photographs, model, fit, kernels_for(cpu), cpu, fractions)
    return {
        "scene": scene,
        "quality": quality,
        "brief": {fraction: each.psnr_db for fraction, each in zip(fractions, fits, strict=True)},
        "seconds": time.monotonic() - started,
        "whole": summary["psnr"],
    }


def errors(lines: Sequence[dict], fraction: float, ratio: float) -> list[float]:
    """Returns the error in dB of each line's prediction by the fits of a fraction and its half."""
    return [
        extrapolated_psnr(
            line["brief"][str(fraction / 2)],
            line["brief"][str(fraction)],
            -math.log2(fraction),
            ratio,
        )
        - line["whole"]
        for line in lines
    ]


def best_ratio(lines: Sequence[dict], fraction: float) -> float:
    """Returns the ratio of the least squared error."""
    return float(min(RATIOS, key=lambda ratio: np.square(errors(lines, fraction, ratio)).sum()))


def ratios(lines: Sequence[dict]) -> Iterator[str]:
    """Yields a line for each fraction, and each scene's error with the ratio of the others."""
    for fraction in FRACTIONS[1:]:
        ratio = best_ratio(lines, fraction)
        others = [[other for other in lines if other is not line] for line in lines]
        apart = [
            errors([line], fraction, best_ratio(rest, fraction))[0]
            for line, rest in zip(lines, others, strict=True)
        ]
        rms = [
            float(np.sqrt(np.mean(np.square(e)))) for e in (errors(lines, fraction, ratio), apart)
        ]
        all_lines, apart_rms = rms
        yield (
            f"1/{1 / fraction:.0f}: ratio {ratio:.2f}, error {all_lines:.2f} dB,"
            f" apart {apart_rms:.2f} dB"
        )
        for line, error in zip(lines, apart, strict=True):
            yield f"    {line['scene']} {line['quality']}: {line['whole']:.2f} dB, {error:+.2f}"


def main() -> None:
    """Fits, or prints what fits say."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    fit = commands.add_parser("fit")
    fit.add_argument("scenes", nargs="+")
    fit.add_argument("--quality", default="draft")
    fit.add_argument("--to", type=Path, required=True)
    commands.add_parser("ratio").add_argument("lines", type=Path)
    options = parser.parse_args()
    if options.command == "ratio":
        lines = [json.loads(line) for line in options.lines.read_text().splitlines()]
        sys.stdout.writelines(f"{line}\n" for line in ratios(lines))
        return
    for scene in options.scenes:
        with options.to.open("a") as file:
            file.write(f"{json.dumps(measured(scene, options.quality, FRACTIONS))}\n")


if __name__ == "__main__":
    main()
