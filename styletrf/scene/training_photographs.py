"""The photographs that a scene is fitted to: all but those held out to measure by.

The scene model and the field read a scene through this file alone. So no photograph held out has a
part in any decision or fit: not by its pixels, its mask, its camera, or its observations of the
points. Cameras and points themselves were solved from all photographs together, as is the custom.
The points' mean colors (`SparsePoints.rgb`) come from all photographs, too; they are only drawn in
reports.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from styletrf.capture.masks import mask_of_view
from styletrf.errors import InputError
from styletrf.files.images import read_rgb
from styletrf.files.tables import read_summary
from styletrf.geometry.camera_table import read_cameras, read_fitted_rows
from styletrf.geometry.cameras import Camera
from styletrf.geometry.point_table import SparsePoints, read_points
from styletrf.scene.explained_pixels import explained_pixels
from styletrf.scene.exposure_choice import exposure_evidence, taken_by_several
from styletrf.scene.observed_colors import observed_colors
from styletrf.scene.scene_model import SceneModel, SceneModelConfig, decide_scene_model
from styletrf.scene.view_dependence import view_dependence


@dataclass(frozen=True, slots=True)
class TrainingPhotographs:
    """The photographs that a scene is fitted to, with their cameras and points.

    Attributes:
        folder: The folder of the undistorted images, `NAME.png`; masks lie beside it.
        cameras: The cameras of the photographs, in the world of the structure from motion.
        points: All sparse points, with the observations by these photographs alone; observations
            count the cameras in their order.
        long_sides_px: The longer sides of the photographs as they came, in pixels; none where these
            are not known.
    """

    folder: Path
    cameras: Sequence[Camera]
    points: SparsePoints
    long_sides_px: Sequence[int] = ()

    def images(self) -> Iterator[Float[np.ndarray, "height width 3"]]:
        """Yields the images in the cameras' order, RGB in [0, 1]."""
        return (read_rgb(self.folder / f"{camera.name}.png") for camera in self.cameras)

    def masks(self) -> Iterator[Bool[np.ndarray, "height width"] | None]:
        """Yields which pixels of each image count; None where all do."""
        return (mask_of_view(self.folder, camera.name) for camera in self.cameras)


def read_training_photographs(poses: Path) -> TrainingPhotographs:
    """Returns the photographs to fit to, of a folder that `solve_camera_poses` wrote.

    Raises:
        InputError: All photographs are held out, or a camera or a point is not finite.
    """
    table = poses / "cameras.parquet"
    cameras, rows = read_cameras(table), read_fitted_rows(table)
    if not rows:
        raise InputError(
            f"the {len(cameras)} photographs with a camera",
            "are all held out to measure by, so that none is left to fit to",
            "Add photographs, or mark fewer as the test part of the split",
        )
    points = read_points(poses / "points.parquet").of_images(rows)
    fitted = [cameras[row] for row in rows]
    sizes = read_summary(poses / "poses.json")["photograph_sizes"]
    long_sides_px = [max(sizes[camera.name]) for camera in fitted]
    return TrainingPhotographs(poses / "images", fitted, points, long_sides_px)


def model_of_photographs(photographs: TrainingPhotographs, config: SceneModelConfig) -> SceneModel:
    """Returns the model of a scene, decided from all that its photographs show.

    Raises:
        InputError: They show too little, or the space that is set cannot hold the scene.
        NotFiniteError: A point, a camera or the model is not finite.
    """
    cameras, points = list(photographs.cameras), photographs.points
    observed = observed_colors(photographs.images(), points)
    return decide_scene_model(
        cameras,
        points.xyz_world,
        config,
        view_dependence(observed, points, cameras),
        explained_pixels(photographs.images(), cameras, points, photographs.masks()),
        exposure_evidence(
            points,
            observed.log_color,
            cameras,
            several_cameras=taken_by_several(photographs.long_sides_px),
        ),
    )
