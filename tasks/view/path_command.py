"""The command that renders a path as the viewer shows it."""

import json
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path


def path_command(
    file: Path, seconds: float, weights: Mapping[str, float], arguments: Sequence[str], style: str
) -> str:
    """Returns the shell command of the fly-through along a path.

    Args:
        file: The file of the path.
        seconds: Its length.
        weights: The weights of the mixed paintings, above 0; the photographs have the rest of 1.
        arguments: The scene, the quality and all other arguments that the fields were made with.
        style: The painting of a command where `weights` has none.
    """
    first, *others = weights or [style]
    mixture = ["--style", first]
    if others:
        mixture += ["--blend", json.dumps({name: weights[name] for name in others})]
    elif weights.get(first, 0.0) < 1:
        mixture += ["--strength", f"{weights.get(first, 0.0):g}"]
    path = ["--path", str(file), "--seconds", f"{seconds:g}"]
    command = ["luigi", "--module", "tasks", "StylizedTrajectory"]
    return shlex.join([*command, *arguments, *mixture, *path])
