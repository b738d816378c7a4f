"""The painting."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from styletrf.files.images import write_rgb
from styletrf.steps.step_run import StepRun
from styletrf.style.style_image import read_style_image


def check_painting(
    inputs: Mapping[str, Path],
    out: Path,
    settings: Mapping[str, Any],
    run: StepRun,
    *,
    painting: Path,
) -> None:
    """Writes `style.png`.

    Args:
        inputs: Empty.
        out: The folder to fill.
        settings: Empty.
        run: Not used.
        painting: The user's image.

    Raises:
        InputError: The image is absent, too small, or all one color.
    """
    write_rgb(out / "style.png", read_style_image(painting))
