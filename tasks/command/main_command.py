"""The command line of a result, as reports repeat it and a trade-off recommends it."""

import json
import shlex
from collections.abc import Mapping
from typing import Any


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
        text = value if isinstance(value, str) else json.dumps(_plain(value))
        command += [f"--{name.replace('_', '-')}", text]
    return shlex.join(command)


def _plain(value: Any) -> Any:
    """Luigi's frozen mappings and tuples as those of JSON."""
    if isinstance(value, Mapping):
        return {name: _plain(inner) for name, inner in value.items()}
    return [_plain(inner) for inner in value] if isinstance(value, list | tuple) else value
