"""The main command in words, as a report repeats it and a trade-off recommends it."""

import json
import shlex
from collections.abc import Mapping
from typing import Any


def main_command(words: Mapping[str, Any], tuning: Mapping[str, Mapping[str, Any]]) -> str:
    """Returns what to type for a stylised trajectory.

    Args:
        words: Parameters and their values.
        tuning: Settings that are not the quality's own, by stage.
    """
    command = ["luigi", "--module", "tasks", "StylizedTrajectory"]
    for name, value in {**words, **({"tuning": tuning} if tuning else {})}.items():
        told = json.dumps(dict(value)) if isinstance(value, Mapping) else str(value)
        command += [f"--{name.replace('_', '-')}", told]
    return shlex.join(command)
