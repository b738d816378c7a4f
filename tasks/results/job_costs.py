"""The cost of a whole fly-through here at each quality.

The prediction runs in another interpreter, because it reads the settings of every stage. Otherwise
the code of all stages would be part of the key of `SceneReport`.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.code.interpreters import json_from

_PREDICTION = "tasks.results.job_cost_prediction:main"
_PAINTING = "any painting"  # its name decides no cost


@dataclass(frozen=True, slots=True)
class JobCost:
    """The costs of a command from an empty store to its report.

    Attributes:
        seconds: The seconds of all stages, one after the other.
        field_seconds: The seconds of the fit among them.
        peak_memory_bytes: The peak memory of the stage that takes most.
        output_bytes: The bytes of all artifacts on disk.
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
    parameters = {"scene": scene, "device": device, "tuning": tuning, "style": _PAINTING}
    found = json_from(_PREDICTION, json.dumps(parameters, default=dict), *qualities)
    return {quality: JobCost(**fields) for quality, fields in found.items()}
