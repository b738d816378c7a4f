"""The cameras of a capture, by COLMAP."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from styletrf.configuration import configured
from styletrf.sfm.camera_poses import CameraPosesConfig, solve_camera_poses
from styletrf.steps.step_run import StepRun


def solve_poses(
    inputs: Mapping[str, Path], out: Path, settings: Mapping[str, Any], run: StepRun
) -> None:
    """Writes `cameras.parquet`, `points.parquet`, `images/` and `poses.json`.

    Args:
        inputs: `capture`.
        out: The folder to fill.
        settings: Those of `CameraPosesConfig`.
        run: The run, beside whose log COLMAP writes its messages.
    """
    config = configured(CameraPosesConfig, settings)
    scratch = run.work / ".colmap"  # hidden, since it is no checkpoint: nothing continues from it
    shutil.rmtree(scratch, ignore_errors=True)  # a killed run may have left files
    scratch.mkdir()
    log = run.log.with_suffix(".colmap") if run.log else None
    solve_camera_poses(inputs["capture"], out, config, run.progress, log, scratch)
