"""Cameras in Parquet: one row an image, readable by any tool.

Columns: name, width, height, model, fx, fy, cx, cy, distortion (list), registered, held_out, and
world_from_camera (12 numbers, row-major 3x4; null where the image is not registered).
"""

from collections.abc import Sequence, Set
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from styletrf.finiteness import require_finite, require_finite_file
from styletrf.geometry.cameras import Camera, camera_numbers

_SCHEMA = pa.schema(
    [
        ("name", pa.string()),
        ("width", pa.int32()),
        ("height", pa.int32()),
        ("model", pa.string()),
        ("fx", pa.float64()),
        ("fy", pa.float64()),
        ("cx", pa.float64()),
        ("cy", pa.float64()),
        ("distortion", pa.list_(pa.float64())),
        ("registered", pa.bool_()),
        ("held_out", pa.bool_()),
        ("world_from_camera", pa.list_(pa.float64())),
    ]
)


def write_cameras(
    path: Path,
    cameras: Sequence[Camera],
    unregistered: Sequence[str] = (),
    held_out: Set[str] = frozenset(),
) -> None:
    """Writes pinhole cameras in the order given, then the names of the unregistered images.

    Those whose names are in `held_out` are for measuring only.

    Raises:
        NotFiniteError: A pose or a lens is not finite.
    """
    require_finite("cameras", f"in {path.name}", map(camera_numbers, cameras))
    rows = [{**_row(camera), "held_out": camera.name in held_out} for camera in cameras]
    rows += [{"name": name, "registered": False} for name in unregistered]
    pq.write_table(pa.Table.from_pylist(rows, schema=_SCHEMA), path)


def read_cameras(path: Path) -> list[Camera]:
    """Returns the registered cameras, in the order of the table.

    Raises:
        InputError: A pose or a lens is not finite.
    """
    return [camera for camera, _ in _registered(path)]


def read_split(path: Path) -> tuple[list[Camera], list[Camera]]:
    """Returns the registered cameras to fit to, and those held out to measure by.

    Raises:
        InputError: A pose or a lens is not finite.
    """
    parts: tuple[list[Camera], list[Camera]] = ([], [])
    for camera, held_out in _registered(path):
        parts[held_out].append(camera)
    return parts


def read_fitted_rows(path: Path) -> list[int]:
    """Returns the rows of the cameras to fit to, as points count them, in the order of the split.

    Raises:
        InputError: A pose or a lens is not finite.
    """
    return [row for row, (_, held_out) in enumerate(_registered(path)) if not held_out]


def read_unregistered(path: Path) -> list[str]:
    """Returns the names of the images that have no camera."""
    return [row["name"] for row in pq.read_table(path).to_pylist() if not row["registered"]]


def _registered(path: Path) -> list[tuple[Camera, bool]]:
    """Returns the registered cameras and whether each is held out."""
    rows = [row for row in pq.read_table(path).to_pylist() if row["registered"]]
    cameras = [(_camera(row), bool(row["held_out"])) for row in rows]
    require_finite_file(path, (camera_numbers(camera) for camera, _ in cameras))
    return cameras


def _row(camera: Camera) -> dict[str, object]:
    return {
        "name": camera.name,
        "width": camera.width,
        "height": camera.height,
        "model": "PINHOLE",
        "fx": camera.fx,
        "fy": camera.fy,
        "cx": camera.cx,
        "cy": camera.cy,
        "distortion": [],
        "registered": True,
        "world_from_camera": camera.world_from_camera.reshape(-1).tolist(),
    }


def _camera(row: dict[str, object]) -> Camera:
    intrinsics = {name: float(str(row[name])) for name in ("fx", "fy", "cx", "cy")}
    return Camera(
        name=str(row["name"]),
        width=int(str(row["width"])),
        height=int(str(row["height"])),
        world_from_camera=np.asarray(row["world_from_camera"], dtype=np.float64).reshape(3, 4),
        **intrinsics,
    )
