"""Poses that a scene already has, whatever format they came in, and their way through a capture."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from styletrf.capture.photographs import FEWEST_PHOTOGRAPHS, natural_order
from styletrf.errors import InputError

GIVEN_BY = "given by "  # begins the name of the mapper where no mapping was needed
NEAR_ROTATION = 1e-2  # by which the columns of a pose may miss being orthonormal


@dataclass(frozen=True, slots=True)
class Lens:
    """A lens as COLMAP describes it: its name of the model, and the parameters, in pixels."""

    model: str
    params: tuple[float, ...]
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class GivenView:
    """A photograph with its lens and its pose, in this project's axes (x right, y down, z ahead).

    `held_out` is the side of a published split that it belongs to; None where there is no split.
    """

    file: Path
    lens: Lens
    world_from_camera: Float[np.ndarray, "3 4"]
    held_out: bool | None = None


@dataclass(frozen=True, slots=True)
class GivenPoses:
    """Views with poses, the file or folder of the poses, and missing photographs that it names."""

    source: Path
    views: tuple[GivenView, ...]
    missing: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The name of the source file; of a folder, its name after its parent's: `sparse/0`."""
        parts = self.source.parts[-2:] if self.source.is_dir() else [self.source.name]
        return "/".join(parts)

    @property
    def files(self) -> list[Path]:
        """The photographs, and all other files that were read."""
        sources = [self.source] if self.source.is_file() else sorted(self.source.iterdir())
        return [*(view.file for view in self.views), *sources]


def is_there(file: Path) -> bool:
    """Returns whether a photograph exists; false for a name that is too long for a file."""
    try:
        return file.is_file()
    except OSError:
        return False


def rigid(name: str, source: Path, pose: np.ndarray) -> Float[np.ndarray, "3 4"]:
    """Returns a pose as a center and the rotation that is nearest to the given matrix.

    Raises:
        InputError: It is not finite, singular, mirrored or far from a rotation times a scale.
    """
    remedy = "Export the poses again"
    if pose.shape not in ((3, 4), (4, 4)) or not np.isfinite(pose).all():
        raise InputError(
            str(source), f"the pose of {name} is not 3x4 or 4x4 finite numbers", remedy
        )
    linear, center = pose[:3, :3].astype(np.float64), pose[:3, 3].astype(np.float64)
    u, singular, vt = np.linalg.svd(linear)
    if singular[2] < (1 - NEAR_ROTATION) * singular[0] or np.linalg.det(linear) <= 0:
        problem = f"the pose of {name} is no rotation: its matrix is singular, skewed or mirrored"
        raise InputError(str(source), problem, remedy)
    return np.column_stack([u @ vt, center])


def require_inside(source: Path, folder: Path, place: Path) -> None:
    """Refuses a photograph, or its folder, that lies elsewhere than the scene, by links too.

    A photograph elsewhere is in no key, and would be copied into a store that others may share.

    Args:
        source: The file that names it.
        folder: Where the scene's photographs are.
        place: Whether or not it is there.

    Raises:
        InputError: It is outside the folder, or no path at all.
    """
    try:
        is_inside = place.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):  # a loop of links, a name with a NUL
        is_inside = False
    if not is_inside:
        problem = f"names a photograph outside {folder}: {str(place)!r}"
        raise InputError(str(source), problem, "Copy the photographs into the scene's folder")


def given_poses(source: Path, views: Sequence[GivenView]) -> GivenPoses:
    """Returns the views whose photographs are there, in the natural order of these.

    Raises:
        InputError: There are fewer than three; it names the missing ones. Or one is named twice.
    """
    ordered = sorted(views, key=lambda view: natural_order(str(view.file)))
    present = tuple(view for view in ordered if is_there(view.file))
    missing = tuple(view.file.name for view in views if not is_there(view.file))
    if len(present) < FEWEST_PHOTOGRAPHS:
        problem = f"has poses of {len(present)} photographs that are there"
        names = f"; missing: {', '.join(missing[:10])}" if missing else ""
        raise InputError(str(source), problem + names, "Put the photographs where it says")
    _require_one_pose(source, present)
    return GivenPoses(source, present, missing)


def _require_one_pose(source: Path, views: Sequence[GivenView]) -> None:
    times = Counter(view.file.resolve() for view in views)
    if again := dict.fromkeys(v.file.name for v in views if times[v.file.resolve()] > 1):
        problem = f"has several poses of one photograph: {', '.join([*again][:10])}"
        raise InputError(str(source), problem, "Give each photograph one pose")


def write_given_poses(path: Path, source: str, views: Mapping[str, GivenView]) -> None:
    """Writes poses by the names of their photographs, as JSON."""
    rows = [
        {
            "name": name,
            "lens": {
                "model": view.lens.model,
                "params": view.lens.params,
                "width": view.lens.width,
                "height": view.lens.height,
            },
            "world_from_camera": view.world_from_camera.tolist(),
            "held_out": view.held_out,
        }
        for name, view in views.items()
    ]
    path.write_text(json.dumps({"source": source, "views": rows}, indent=1) + "\n")


def poses_are_given(poses: Path) -> bool:
    """Returns whether the poses that `solve_camera_poses` wrote came with the photographs."""
    report: dict[str, Any] = json.loads((poses / "poses.json").read_text())
    return str(report.get("mapper", "")).startswith(GIVEN_BY)


def read_given_poses(path: Path) -> tuple[str, dict[str, GivenView]]:
    """Returns the poses of `write_given_poses`: the source's name, and the views by name."""
    values: dict[str, Any] = json.loads(path.read_text())
    views = {}
    for row in values["views"]:
        lens = Lens(**{**row["lens"], "params": tuple(row["lens"]["params"])})
        pose = np.array(row["world_from_camera"])
        views[row["name"]] = GivenView(Path(row["name"]), lens, pose, row["held_out"])
    return values["source"], views
