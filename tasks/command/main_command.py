"""The command line of a result, as reports repeat it and a trade-off recommends it."""

import json
import shlex
from collections.abc import Mapping
from typing import Any


def main_command(arguments: Mapping[str, Any], tuning: Mapping[str, Mapping[str, Any]]) -> str:
    """Returns the shell command for a stylized trajectory.

    Args:
        arguments: Parameters and their values.
        tuning: Settings that differ from the preset, by stage.
    """
    command = ["luigi", "--module", "tasks", "StylizedTrajectory"]
    for name, value in {**arguments, **({"tuning": tuning} if tuning else {})}.items():
        text = json.dumps(dict(value)) if isinstance(value, Mapping) else str(value)
        command += [f"--{name.replace('_', '-')}", text]
    return shlex.join(command)
