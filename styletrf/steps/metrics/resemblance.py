"""The resemblance of stylized frames to the painting and to the scene."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from styletrf.configuration import configured
from styletrf.devices import device_named
from styletrf.evaluation.resemblance.efficientnet_lite import load_efficientnet
from styletrf.evaluation.resemblance.frame_resemblance import (
    ResemblanceConfig,
    measure_resemblance,
)
from styletrf.evaluation.resemblance.picture_traits import TraitMeter
from styletrf.files.images import read_rgb
from styletrf.files.tables import write_rows, write_summary
from styletrf.steps.metrics.frame_reader import frames_of, objects_of
from styletrf.steps.step_run import StepRun
from styletrf.style.perceptual.vgg import load_vgg


def measure_frame_resemblance(
    inputs: Mapping[str, Path], out: Path, settings: Mapping[str, Any], run: StepRun
) -> None:
    """Writes `frames.parquet` and `summary.json`.

    Args:
        inputs: `unstylized`, `stylized`, `style`, `perceptual`, and `priors` if there are any.
        out: The folder to fill.
        settings: Those of `ResemblanceConfig`.
        run: Its progress is the number of frames.
    """
    config, device = configured(ResemblanceConfig, settings), device_named(run.device_name)
    vgg = load_vgg(inputs["perceptual"] / "vgg16.safetensors", device)
    priors = sorted((inputs["priors"] / "frames").iterdir()) if "priors" in inputs else []
    rows, summary = measure_resemblance(
        *frames_of(inputs),
        read_rgb(inputs["style"] / "style.png"),
        [read_rgb(path) for path in priors],
        TraitMeter(vgg, load_efficientnet(device), config.traits),
        config,
        run.progress,
        objects=objects_of(inputs, on_one_color=False),
    )
    write_rows(out / "frames.parquet", rows)
    write_summary(out / "summary.json", summary)
