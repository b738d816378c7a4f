"""The command line of a result, as reports repeat it and a trade-off recommends it."""

import json
import shlex
from collections.abc import Mapping
from typing import Any

from luigi.freezing import recursively_unfreeze


def main_command(
    arguments: Mapping[str, Any],
    tuning: Mapping[str, Mapping[str, Any]],
    task: str = "StylizedTrajectory",
) -> str:
    """Returns the shell command for a stylized trajectory, or for another result.

    Args:
        arguments: Parameters and their values.
        tuning: Settings that differ from the preset, by stage.
        task: The family of the result.
    """
    command = ["luigi", "--module", "tasks", task]
    for name, value in {**arguments, **({"tuning": tuning} if tuning else {})}.items():
        text = value if isinstance(value, str) else json.dumps(recursively_unfreeze(value))  # type: ignore[no-untyped-call]
        command += [f"--{name.replace('_', '-')}", text]
    return shlex.join(command)
