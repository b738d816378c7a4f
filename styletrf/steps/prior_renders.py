"""Renders of the few views to stylize, which together cover all that the trajectory sees."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from styletrf.configuration import configured
from styletrf.devices import device_named
from styletrf.field.radiance_field import load_field
from styletrf.geometry.cameras import Camera
from styletrf.progress import Progress
from styletrf.steps.path_renders import PathSource, render_path
from styletrf.steps.sharding import Sharding
from styletrf.stylization.priors import PriorsConfig, needed_views
from styletrf.trajectory.trajectories import prior_views


def render_priors(
    inputs: Mapping[str, Path],
    out: Path,
    settings: Mapping[str, Any],
    device_name: str,
    sharding: Sharding,
    progress: Progress,
) -> None:
    """Writes the renders as `render_path` does.

    Args:
        inputs: `field`, `poses`, `model` and `trajectory`.
        out: The folder to fill.
        settings: Of `PriorsConfig`.
        device_name: `auto`, `cpu` or `cuda`.
        sharding: Which renders to make.
        progress: Called with the number of renders.
    """
    config = configured(PriorsConfig, settings)

    def choose(source: PathSource) -> list[Camera]:
        """Returns the chosen viewpoints among candidates around the fly-through."""
        return needed_views(
            prior_views(source.photographed, source.model, config.trajectory),
            source.inputs["trajectory"],
            load_field(source.inputs["field"]),
            source.model.space,
            config,
            device_named(source.device_name),
        )

    render_path(inputs, out, config, device_name, sharding, choose, progress)
