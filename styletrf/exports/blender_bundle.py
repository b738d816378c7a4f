"""Meshes, cameras and a script that brings them into Blender.

Blender's importer of glTF turns (x, y, z) to (x, -z, y), and a camera of Blender looks along its
-z, with y up. The matrices in `cameras.json` include both: the script only assigns them.
"""

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from styletrf.exports.splat_files import UP_FROM_DOWN
from styletrf.geometry.cameras import Camera, moved

BLENDER_FROM_GLTF = np.array(
    [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
# Text, not code of this package: it runs in Blender.
_SCRIPT = Path(__file__).with_name("blender_import.py.txt")
_SENSOR_MM = 36.0


def write_blender_bundle(
    folder: Path,
    photographed: Sequence[Camera],
    path: Sequence[Camera],
    frames_per_second: float,
) -> None:
    """Writes `cameras.json` and `import_scene.py` beside the meshes.

    Args:
        folder: The folder to fill.
        photographed: The photographs' cameras, in the world.
        path: The fly-through, in the world.
        frames_per_second: The rate of the fly-through.
    """
    values = {
        "photographs": [_in_blender(camera) for camera in photographed],
        "path": [_in_blender(camera) for camera in path],
        "frames_per_second": frames_per_second,
    }
    (folder / "cameras.json").write_text(json.dumps(values, indent=1) + "\n")
    shutil.copyfile(_SCRIPT, folder / "import_scene.py")


def _in_blender(camera: Camera) -> dict[str, Any]:
    """Returns name, size, lens and the 4x4 matrix of Blender's world from its camera.

    Blender measures the sensor and shifts by the side that is longer once its pixels have their
    aspect, in widths of a pixel. It has no aspect below 1.
    """
    placed = moved(camera, BLENDER_FROM_GLTF @ UP_FROM_DOWN)
    matrix: Float[np.ndarray, "4 4"] = np.vstack([placed.world_from_camera, [0.0, 0.0, 0.0, 1.0]])
    pixel_height = camera.fx / camera.fy  # in widths of a pixel
    longer = max(camera.width, camera.height * pixel_height)
    return {
        "name": camera.name,
        "width": camera.width,
        "height": camera.height,
        "matrix_world": (matrix @ UP_FROM_DOWN).tolist(),
        "lens_mm": camera.fx * _SENSOR_MM / longer,
        "sensor_mm": _SENSOR_MM,
        "shift_x": (camera.width / 2 - camera.cx) / longer,
        "shift_y": (camera.cy - camera.height / 2) * pixel_height / longer,
        "pixel_aspect_x": max(1.0, 1 / pixel_height),
        "pixel_aspect_y": max(1.0, pixel_height),
    }
