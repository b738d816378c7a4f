"""The number and size of scenes' photographs, found by an interpreter of its own."""

import contextlib
import functools
import subprocess
from collections.abc import Mapping
from typing import Any

from pipeline.code.interpreters import json_from
from tasks.planning.memory_demand import Photographs


@functools.cache
def sizes_of(scenes: tuple[str, ...]) -> Mapping[str, Photographs]:
    """Returns the photographs of each scene; those that cannot be read are left out."""
    found: dict[str, dict[str, Any]] = {}
    with contextlib.suppress(subprocess.CalledProcessError):
        found = json_from("tasks.planning.scene_photographs:main", *scenes)
    return {scene: Photographs(**fields) for scene, fields in found.items()}
