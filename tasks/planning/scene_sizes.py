"""How many photographs scenes have, and of what size, as an interpreter of its own finds."""

import functools
import json
import os
import subprocess
import sys
from collections.abc import Mapping
from typing import Any

from tasks.planning.memory_demand import Photographs

_MAIN = "from tasks.planning.scene_photographs import main; main()"


@functools.cache
def sizes_of(scenes: tuple[str, ...]) -> Mapping[str, Photographs]:
    """Returns the photographs of each scene; those that cannot be read are left out."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-P", "-c", _MAIN, *scenes]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False, env=environment)
    found: dict[str, dict[str, Any]] = json.loads(done.stdout) if done.returncode == 0 else {}
    return {scene: Photographs(**fields) for scene, fields in found.items()}
