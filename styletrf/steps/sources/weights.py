"""Weights of published networks, downloaded or given by the user."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from styletrf.steps.step_run import StepRun
from styletrf.style.perceptual.perceptual_weights import build_perceptual_weights
from styletrf.style.transfer.weights import build_transfer_weights


def fetch_perceptual_weights(
    inputs: Mapping[str, Path], out: Path, settings: Mapping[str, Any], run: StepRun, *, source: str
) -> None:
    """Writes `vgg16.safetensors` and `weights.json`.

    Args:
        inputs: Empty.
        out: The folder to fill.
        settings: Empty.
        run: Not used.
        source: See `build_perceptual_weights`, also for errors.
    """
    build_perceptual_weights(source, out)


def fetch_transfer_weights(
    inputs: Mapping[str, Path], out: Path, settings: Mapping[str, Any], run: StepRun, *, source: str
) -> None:
    """Writes `predictor`, `conditioning` and `transfer.safetensors`, and `weights.json`.

    Args:
        inputs: Empty.
        out: The folder to fill.
        settings: Empty.
        run: Not used.
        source: See `build_transfer_weights`, also for errors.
    """
    build_transfer_weights(source, out)
