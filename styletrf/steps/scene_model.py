"""The scene model, from the photographs that are not held out."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from styletrf.configuration import configured
from styletrf.scene.scene_model import SceneModelConfig, write_scene_model
from styletrf.scene.training_photographs import model_of_photographs, read_training_photographs
from styletrf.steps.step_run import StepRun


def decide_model(
    inputs: Mapping[str, Path], out: Path, settings: Mapping[str, Any], run: StepRun
) -> None:
    """Writes `scene.json`.

    Args:
        inputs: `poses`.
        out: The folder to fill.
        settings: Those of `SceneModelConfig`.
        run: Not used.
    """
    photographs = read_training_photographs(inputs["poses"])
    model = model_of_photographs(photographs, configured(SceneModelConfig, settings))
    write_scene_model(out / "scene.json", model)
