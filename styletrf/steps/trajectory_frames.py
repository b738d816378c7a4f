"""The unstylized frames of the fly-through, or of another path."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from styletrf.capture.poses.given_poses import poses_are_given
from styletrf.configuration import configured
from styletrf.devices import device_named
from styletrf.field.radiance_field import load_field
from styletrf.files.tables import read_summary
from styletrf.geometry.camera_table import read_split
from styletrf.geometry.cameras import Camera
from styletrf.geometry.lenses import at_size
from styletrf.steps.path_renders import PathSource, render_path
from styletrf.steps.step_run import StepRun
from styletrf.trajectory.chosen_path import chosen_path, default_path
from styletrf.trajectory.frames import FramesConfig
from styletrf.trajectory.support import SupportMeter
from styletrf.trajectory.supported_path import SupportedPath, write_support


def render_trajectory(
    inputs: Mapping[str, Path],
    out: Path,
    settings: Mapping[str, Any],
    run: StepRun,
    *,
    path: str,
    path_name: str,
) -> None:
    """Writes the renders as `render_path` does, and `support.json`.

    Args:
        inputs: `field`, `poses` and `model`; or the shards to join.
        out: The folder to fill.
        settings: Those of `FramesConfig`.
        run: Its progress is the number of frames.
        path: `auto`, the name of a path, or a file.
        path_name: Its name in `support.json`.
    """
    config = configured(FramesConfig, settings)

    def choose(source: PathSource) -> list[Camera]:
        """Returns the requested path; for `auto` a fly-through as wide as photographs support."""
        found = _supported(source, path, config)
        write_support(out / "support.json", path_name, found, config.support)
        if not config.enlarged:  # the cameras found are no larger than the photographs
            return list(found.cameras)
        return [at_size(camera, config.long_side_px, 0.0) for camera in found.cameras]

    render_path(inputs, out, config, run, choose)


def _supported(source: PathSource, path: str, config: FramesConfig) -> SupportedPath:
    poses, model = source.inputs["poses"], source.model
    fitted = model.normalized(read_split(poses / "cameras.parquet")[0])
    field, device = load_field(source.inputs["field"]), device_named(source.device_name)
    images = None if model.exposures else poses / "images"  # else their colors are not the field's
    meter = SupportMeter(fitted, field, model.space, config.support, device, images)
    of = source.photographed, model, config
    if path == "auto":
        has_parallax = read_summary(poses / "poses.json")["tells_depth"]
        return default_path(*of, meter.measure, has_parallax=has_parallax)
    chosen = chosen_path(path, *of, are_given=poses_are_given(poses))
    return SupportedPath(chosen, meter.measure(chosen))
