"""The field in the style of the stylized priors."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from styletrf.configuration import configured
from styletrf.devices import device_named
from styletrf.field.radiance_field import save_appearance, save_field
from styletrf.files.tables import write_curve
from styletrf.steps.step_run import StepRun
from styletrf.stylization.strategies import (
    Match,
    StylizationConfig,
    load_stylization,
    stylized,
    stylized_with_own_density,
)

Strategy = Literal["s1", "s2", "s3"]


def stylize_field(
    inputs: Mapping[str, Path],
    out: Path,
    settings: Mapping[str, Any],
    run: StepRun,
    *,
    factors: tuple[float, float],
    strategy: Strategy,
    match: Match,
) -> None:
    """Writes the stylized field: `appearance.safetensors`, `field.json`, `density.json`, a curve.

    `density.json` names the field whose density is shared; s1 and s2 write `density.safetensors`.

    Args:
        inputs: `field`, `model`, `priors`, `stylized`; `poses` for s1; `style` and `perceptual` for
            a loss on renders, and `transfer` where it is of distributions.
        out: The folder to fill.
        settings: Those of `StylizationConfig`.
        run: Its progress is the iteration and the loss.
        factors: The stroke scale and the content weight.
        strategy: `s3` adapts the appearance, `s2` the whole field; `s1` fits a new one.
        match: The loss.
    """
    config = configured(StylizationConfig, settings).with_style_parameters(*factors)
    job = load_stylization(inputs, device_named(run.device_name), match)
    if strategy == "s3":
        field, curve, dropped = stylized(job, config, run.progress)
        save_appearance(out, field)
    else:
        field, curve = stylized_with_own_density(
            job, config, run.progress, from_scratch=strategy == "s1"
        )
        dropped = 0.0
        save_field(out, field)
    write_curve(out / "curve.parquet", curve)
    shared = inputs["field"].name if strategy == "s3" else None
    density = {"density_of": shared, "dropped_weight": dropped}
    (out / "density.json").write_text(json.dumps(density, indent=1, sort_keys=True) + "\n")
