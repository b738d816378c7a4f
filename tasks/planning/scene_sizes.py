"""The number and size of scenes' photographs, found by a process of its own."""

import contextlib
import functools
import json
from collections.abc import Mapping
from typing import Any

from pipeline.code.interpreters import json_of_last_line
from pipeline.execution.fork_server import output_of
from tasks.planning.memory_demand import Photographs


@functools.cache
def sizes_of(scenes: tuple[str, ...]) -> Mapping[str, Photographs]:
    """Returns the photographs of each scene; those that cannot be read are left out."""
    found: dict[str, dict[str, Any]] = {}
    with contextlib.suppress(RuntimeError, ValueError):
        answer = output_of("tasks.planning.scene_photographs:main", json.dumps(scenes))
        found = json_of_last_line(answer)
    return {scene: Photographs(**fields) for scene, fields in found.items()}
