"""How many photographs scenes have, and of what size, as an interpreter of its own finds."""

import functools
import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from tasks.planning.memory_demand import Photographs, photographs_of

_MAIN = "from tasks.planning.scene_sizes import main; main()"
_VIDEO_FRAMES = 60


@functools.cache
def sizes_of(scenes: tuple[str, ...]) -> Mapping[str, Photographs]:
    """Returns the photographs of each scene; those that cannot be read are left out."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-P", "-c", _MAIN, *scenes]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False, env=environment)
    found: dict[str, dict[str, Any]] = json.loads(done.stdout) if done.returncode == 0 else {}
    return {scene: Photographs(**fields) for scene, fields in found.items()}


def main() -> None:
    """Writes them as JSON, of what the words of the command name."""
    photographs = {scene: photographs_of(scene, _VIDEO_FRAMES) for scene in sys.argv[1:]}
    json.dump({s: asdict(found) for s, found in photographs.items() if found}, sys.stdout)
