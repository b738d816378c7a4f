"""The temporal consistency of stylized frames."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from styletrf.configuration import configured
from styletrf.devices import device_named
from styletrf.evaluation.consistency.frame_pairs import read_frame
from styletrf.evaluation.consistency.trajectory_consistency import (
    ConsistencyConfig,
    measure_consistency,
)
from styletrf.evaluation.perceptual_distance import PerceptualFeatures
from styletrf.files.images import read_rgb
from styletrf.files.tables import read_summary, write_rows, write_summary
from styletrf.geometry.camera_table import read_cameras
from styletrf.steps.step_run import StepRun
from styletrf.style.perceptual.vgg import load_vgg
from styletrf.trajectory.stills import cuts_of


def measure_temporal_consistency(
    inputs: Mapping[str, Path], out: Path, settings: Mapping[str, Any], run: StepRun
) -> None:
    """Writes `pairs.parquet` and `summary.json`.

    Args:
        inputs: `unstylized`, `stylized`, `style` and `perceptual`.
        out: The folder to fill.
        settings: Those of `ConsistencyConfig`.
        run: Its progress is the number of pairs.
    """
    config = configured(ConsistencyConfig, settings)
    cameras = read_cameras(inputs["unstylized"] / "cameras.parquet")
    vgg = load_vgg(inputs["perceptual"] / "vgg16.safetensors", device_named(run.device_name))
    consistency = measure_consistency(
        (read_frame(inputs["unstylized"], inputs["stylized"], camera) for camera in cameras),
        len(cameras),
        read_rgb(inputs["style"] / "style.png"),
        PerceptualFeatures(vgg, config.perceptual_px),
        config,
        run.progress,
        cuts_of(read_summary(inputs["unstylized"] / "support.json")),
    )
    write_rows(out / "pairs.parquet", consistency.pairs)
    write_summary(out / "summary.json", consistency.summary)
