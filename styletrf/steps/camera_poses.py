"""The cameras of a capture, by COLMAP."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from styletrf.configuration import configured
from styletrf.progress import Progress
from styletrf.sfm.camera_poses import CameraPosesConfig, solve_camera_poses


def solve_poses(
    capture: Path, out: Path, settings: Mapping[str, Any], progress: Progress, log: Path, work: Path
) -> None:
    """Writes `cameras.parquet`, `points.parquet`, `images/` and `poses.json`.

    Args:
        capture: The folder of `capture_scene`.
        out: The folder to fill.
        settings: Of `CameraPosesConfig`.
        progress: Called with the work done.
        log: Receives COLMAP's messages.
        work: A folder for COLMAP, which is emptied first: a killed run may have left files.
    """
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    config = configured(CameraPosesConfig, settings)
    solve_camera_poses(capture, out, config, progress, log, work)
