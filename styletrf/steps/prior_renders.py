"""Renders of the few views to stylize, which together cover all that the trajectory sees."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from styletrf.configuration import configured
from styletrf.devices import device_named
from styletrf.field.radiance_field import load_field
from styletrf.geometry.cameras import Camera
from styletrf.steps.path_renders import PathSource, render_path
from styletrf.steps.step_run import StepRun
from styletrf.stylization.priors import PriorsConfig, needed_views
from styletrf.trajectory.trajectories import prior_views


def render_priors(
    inputs: Mapping[str, Path], out: Path, settings: Mapping[str, Any], run: StepRun
) -> None:
    """Writes the renders as `render_path` does.

    Args:
        inputs: `field`, `poses`, `model` and `trajectory`; or the shards to join.
        out: The folder to fill.
        settings: Those of `PriorsConfig`.
        run: Its progress is the number of renders.
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

    render_path(inputs, out, config, run, choose)
