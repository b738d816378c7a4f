"""Places photographs against the field that structure from motion could not place.

Features need texture that is sharp in two photographs. A field that is fitted shows the scene from
anywhere, and direct alignment (`styletrf.evaluation.alignment.image_alignment`) compares whole
images: it places blurred and dark photographs, too. A photograph counts as placed where its detail
agrees with the render's nearly as well as that of photographs whose cameras are known.
"""

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float

from styletrf.capture.capture_file import Photograph, read_capture
from styletrf.capture.photographs import read_photograph
from styletrf.capture.views import load_views
from styletrf.colmap import pycolmap
from styletrf.evaluation.alignment.image_alignment import (
    LONG_SIDES_PX,
    Image,
    Render,
    aligned,
    at_pose_of,
    correlation,
    likeness,
    reduced,
)
from styletrf.even_spread import evenly_spread
from styletrf.files.images import from_integers
from styletrf.files.tables import read_summary, write_summary
from styletrf.geometry.camera_table import read_split, read_unregistered
from styletrf.geometry.cameras import Camera, fitted_to, moved
from styletrf.geometry.undistortion import pinhole_for, undistorted_image
from styletrf.scene.scene_model import SceneModel

_LOGGER = logging.getLogger(__name__)
LEAST_DETAIL = 0.5  # correlation with the render, below which a photograph is of something else
LEAST_FRACTION = 0.75  # of the way from a photograph beside another's render to it beside its own
_STARTS = 4  # known cameras, those of the most similar photographs, from which the search begins
_COMPARED = 12  # photographs with known cameras, which show how alike renders and photographs are
_MOST_TRIED = 20  # photographs without a camera: each takes seconds
_LONG_SIDE_PX = max(LONG_SIDES_PX)  # of the photographs in memory
_SAME_SHAPE = 0.01  # by how much the proportions of a photograph may differ from the lens's

View = tuple[Camera, Image]
"""A photograph at the size of its camera, RGB in [0, 1], no larger than it is compared at."""


def place_unregistered(
    path: Path, capture_dir: Path, poses_dir: Path, model: SceneModel, render: Render
) -> None:
    """Searches the field for the photographs without a camera, and writes the results.

    Args:
        path: The file to write, see `write_placements`.
        capture_dir: What `capture_photographs` wrote.
        poses_dir: What `solve_camera_poses` wrote.
        model: Of the scene.
        render: Renders the field from a camera, in the normalized world.
    """
    unplaced = list(unplaced_photographs(capture_dir, poses_dir))
    known = training_views(poses_dir, model) if unplaced else []
    placements = place_photographs(unplaced, known, render)
    write_placements(path, placements, model.normalized_from_world)


@dataclass(frozen=True, slots=True)
class PhotographPlacement:
    """The outcome for one photograph; `camera` is its best, whether or not it is good enough.

    `detail` and `needed` are correlations with the render: that at the best pose, and the least
    that counts.
    """

    camera: Camera
    detail: float
    needed: float

    @property
    def is_placed(self) -> bool:
        """Whether the photograph shows the same as the field does from there."""
        return self.detail >= self.needed


def unplaced_photographs(capture_dir: Path, poses_dir: Path) -> Iterator[View]:
    """Yields the photographs without a camera, as a lens of the scene would show them.

    The lens is the one that took most of the placed photographs of the same shape, or of this shape
    turned by 90 degrees, as a camera held upright has it. Their cameras stand at the origin. Where
    no lens has their shape, nothing is known of theirs: they are left out, and a warning names
    them. If more than 20 others remain, 20 of them are yielded, evenly spread, and a warning says
    so.

    Args:
        capture_dir: What `capture_photographs` wrote.
        poses_dir: What `solve_camera_poses` wrote.
    """
    missing = set(read_unregistered(poses_dir / "cameras.parquet"))
    if not missing:
        return
    lenses = _lenses(read_summary(poses_dir / "poses.json"))
    lenses += [_turned(lens) for lens in lenses if "FISHEYE" not in str(lens.model_name)]
    photographs = read_capture(capture_dir).photographs
    usable = _with_lenses([one for one in photographs if one.name in missing], lenses)
    if len(usable) > _MOST_TRIED:
        _LOGGER.warning("%d photographs have no camera: %d are tried", len(missing), _MOST_TRIED)
    for one, lens in evenly_spread(usable, _MOST_TRIED):
        image = read_photograph(capture_dir / "images" / one.file)
        size = lens.width, lens.height
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))
        pinhole = pinhole_for(lens, one.name, np.eye(3, 4))
        camera = fitted_to(pinhole, _LONG_SIDE_PX)
        image = undistorted_image(image, lens, pinhole)
        size = camera.width, camera.height
        yield camera, cv2.resize(image, size, interpolation=cv2.INTER_AREA) / 255.0


def _with_lenses(
    photographs: Sequence[Photograph], lenses: Sequence[pycolmap.Camera]
) -> list[tuple[Photograph, pycolmap.Camera]]:
    """Returns the photographs whose shape a lens has, each with the first such lens."""
    usable = []
    for one in photographs:
        lens = next((lens for lens in lenses if _has_shape(one, lens.width, lens.height)), None)
        if lens is None:
            _LOGGER.warning("%s was not placed: no lens has its shape", one.name)
        else:
            usable.append((one, lens))
    return usable


def _lenses(poses: Mapping[str, Any]) -> list[pycolmap.Camera]:
    """Returns the lenses of a record of camera poses; earlier records have the first one only."""
    if "lenses" in poses:
        return [pycolmap.Camera(**found["lens"]) for found in poses["lenses"]]
    model, params = poses["camera_model"], poses["camera_params"]
    size = {"width": poses["width"], "height": poses["height"]}
    return [pycolmap.Camera(model=model, params=params, **size)]


def training_views(poses_dir: Path, model: SceneModel) -> list[View]:
    """Returns the photographs that are not held out, their cameras in the normalized world.

    They are whole: masks have no part in the comparison with photographs without a camera.
    """
    cameras = model.normalized(read_split(poses_dir / "cameras.parquet")[0], _LONG_SIDE_PX)
    images = load_views(poses_dir / "images", cameras)
    pixels = (np.ascontiguousarray(image[..., :3].numpy()) for image in images)
    return list(zip(cameras, map(from_integers, pixels), strict=True))


def _turned(lens: pycolmap.Camera) -> pycolmap.Camera:
    """Returns a lens on a camera that is held upright, without its distortion."""
    focal, width, height = lens.mean_focal_length(), lens.height, lens.width
    params = [focal, focal, width / 2, height / 2]
    return pycolmap.Camera(model="PINHOLE", width=width, height=height, params=params)


def _has_shape(photograph: Photograph, width: int, height: int) -> bool:
    return abs(photograph.width / photograph.height / (width / height) - 1) < _SAME_SHAPE


def place_photographs(
    unplaced: Sequence[View], placed: Sequence[View], render: Render
) -> list[PhotographPlacement]:
    """Returns where each photograph was taken from, by the field.

    Args:
        unplaced: The photographs, with the lens of their cameras.
        placed: Those whose cameras are known; the search begins at them.
        render: Renders the field from a camera.
    """
    if not unplaced or not placed:
        return []
    needed = _needed(placed, render)
    found = []
    for camera, image in unplaced:
        starts = [at_pose_of(camera, known) for known in _most_alike(image, camera, placed)]
        coarse = [aligned(start, image, render, LONG_SIDES_PX[:1]) for start in starts]
        best = max(coarse, key=lambda alignment: alignment.correlation)
        fine = aligned(best.camera, image, render, LONG_SIDES_PX[1:])
        found.append(PhotographPlacement(fine.camera, fine.detail, needed))
    return found


def _needed(placed: Sequence[View], render: Render) -> float:
    """Returns how alike photograph and render must be, by photographs whose cameras are known.

    Beside the render of its own camera each is as alike as one can be here; beside that of the
    camera of the photograph that looks most like it, it is as alike as a wrong pose may be.
    """
    own, other = [], []
    for camera, image in placed[:: -(-len(placed) // _COMPARED)]:
        others = [view for view in placed if view[0] is not camera]
        wrong = [at_pose_of(camera, known) for known in _most_alike(image, camera, others)[:1]]
        own.append(likeness(camera, image, render, max(LONG_SIDES_PX)))
        other += [likeness(one, image, render, max(LONG_SIDES_PX)) for one in wrong]
    usual, confused = float(np.median(own)), float(np.median(other)) if other else 0.0
    return max(LEAST_DETAIL, confused + LEAST_FRACTION * (usual - confused))


def write_placements(
    path: Path,
    placements: Sequence[PhotographPlacement],
    normalized_from_world: Float[np.ndarray, "4 4"],
) -> None:
    """Writes a JSON object: of each photograph by name its figures, and its pose if it is placed.

    `world_from_camera` is in the world of the poses, as in `cameras.parquet`.
    """
    rows: dict[str, dict[str, object]] = {}
    for one in placements:
        row: dict[str, object] = {"detail": one.detail, "needed": one.needed}
        if one.is_placed:
            camera = moved(one.camera, np.linalg.inv(normalized_from_world))
            row["world_from_camera"] = camera.world_from_camera.tolist()
        rows[one.camera.name] = row
    write_summary(path, rows)


def _most_alike(image: Image, camera: Camera, placed: Sequence[View]) -> list[Camera]:
    """Returns the cameras of the photographs that look most like an image, when all are tiny."""
    tiny = fitted_to(camera, LONG_SIDES_PX[0])
    target = reduced(image, tiny)
    alike = [correlation(reduced(other, tiny), target) for _, other in placed]
    return [placed[k][0] for k in np.argsort(alike)[::-1][:_STARTS]]
