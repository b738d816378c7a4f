"""What a whole fly-through costs here at each quality, as an interpreter of its own predicts.

Its own, since the prediction asks every stage for its settings: a page that shows it would
otherwise depend on the code of all stages.
"""

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

_MAIN = "from tasks.results.job_cost_prediction import main; main()"
_PAINTING = "any painting"  # its name decides no cost


@dataclass(frozen=True, slots=True)
class JobCost:
    """The costs of a command from an empty store to its report.

    Attributes:
        seconds: Of all stages, one after the other.
        field_seconds: Of the fit among them.
        peak_memory_bytes: Of the stage that takes most.
        output_bytes: Of all artifacts on disk.
    """

    seconds: float
    field_seconds: float
    peak_memory_bytes: int
    output_bytes: int


def job_costs(
    scene: str, device: str, qualities: Sequence[str], tuning: Mapping[str, Any]
) -> Mapping[str, JobCost]:
    """Returns the cost of `StylizedTrajectory` of a scene, with settings of stages, by quality.

    Raises:
        subprocess.CalledProcessError: The prediction fails.
    """
    words = {"scene": scene, "device": device, "tuning": tuning, "style": _PAINTING}
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-P", "-c", _MAIN, json.dumps(words, default=dict), *qualities]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, env=environment)
    found: dict[str, dict[str, float]] = json.loads(done.stdout.splitlines()[-1])
    return {quality: JobCost(**fields) for quality, fields in found.items()}  # type: ignore[arg-type]
