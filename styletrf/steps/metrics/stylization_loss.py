"""The style and content loss of stylized frames."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from styletrf.configuration import configured
from styletrf.devices import device_named
from styletrf.evaluation.stylization_loss import StylizationLossConfig, measure_stylization
from styletrf.files.images import read_rgb
from styletrf.files.tables import write_rows, write_summary
from styletrf.steps.metrics.frame_reader import frames_of, objects_of
from styletrf.steps.step_run import StepRun
from styletrf.style.perceptual.vgg import load_vgg


def measure_style_and_content(
    inputs: Mapping[str, Path], out: Path, settings: Mapping[str, Any], run: StepRun
) -> None:
    """Writes the style and content loss: `frames.parquet` and `summary.json`.

    Objects that are cut out are compared on their mean color, as they are stylized.

    Args:
        inputs: `unstylized`, `stylized`, `style` and `perceptual`.
        out: The folder to fill.
        settings: Those of `StylizationLossConfig`.
        run: Its progress is the number of frames.
    """
    names, frames = frames_of(inputs)
    rows, means = measure_stylization(
        names,
        objects_of(inputs, on_one_color=True) or frames,
        read_rgb(inputs["style"] / "style.png"),
        load_vgg(inputs["perceptual"] / "vgg16.safetensors", device_named(run.device_name)),
        configured(StylizationLossConfig, settings),
        run.progress,
    )
    write_rows(out / "frames.parquet", rows)
    write_summary(out / "summary.json", means)
