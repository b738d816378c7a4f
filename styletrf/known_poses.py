"""Sparse points of photographs whose poses are known: described, matched and triangulated.

The poses stay as they are given; what COLMAP would have to find out about them is skipped.
"""

from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np

from styletrf.colmap import pycolmap
from styletrf.colmap_images import ColmapImages
from styletrf.colmap_mapping import match_pairs
from styletrf.errors import InputError
from styletrf.given_poses import GivenView
from styletrf.image_pairs import Pairs, all_pairs
from styletrf.mapping_choice import Mapping as Mapped
from styletrf.progress import Progress

NEIGHBOURS = 20  # with which each photograph is matched, where there are more
_WIDEST_DEG = 60.0  # between the views of photographs that are matched
_FEWEST_POINTS = 16
_LARGEST_ERROR = 0.01  # of the longer side, of a reprojection


def map_known_poses(
    database: Path,
    images: ColmapImages,
    views: Sequence[GivenView],
    source: str,
    seed: int,
    progress: Progress,
) -> Mapped:
    """Returns the model of images whose features the database holds, at the given poses.

    Args:
        database: COLMAP's.
        images: In the order of `views`.
        views: Where each was taken from, and with which lens.
        source: Where the poses are from, for messages.
        seed: Of the verification of matches.
        progress: Called for the pairs matched.

    Raises:
        InputError: The photographs do not fit the poses.
    """
    pairs = neighbouring_pairs(views)
    verified = match_pairs(database, images, pairs, seed, progress)
    posed = _posed(database, images, views)
    model = pycolmap.triangulate_points(posed, database, images.folder, database.parent)
    error_px = float(model.compute_mean_reprojection_error())
    if model.num_points3D() < _FEWEST_POINTS or error_px > _LARGEST_ERROR * images.width:
        raise InputError(
            source,
            f"does not fit the photographs: at its poses they share {model.num_points3D()} points,"
            f" {error_px:.1f} px off",
            "Check its axes and the photographs' names, or have the poses solved with"
            """ --CameraPoses-settings '{"poses": "solved"}'""",
        )
    reason = "the poses came with the photographs"
    return Mapped([model], "neighbours", verified, f"given by {source}", reason)


def neighbouring_pairs(views: Sequence[GivenView]) -> Pairs:
    """Returns pairs i < j of views that may show the same: all, or each with its nearest.

    Of those that look the same way within 60 degrees, the nearest 20 by their centres.
    """
    if len(views) <= 2 * NEIGHBOURS:
        return all_pairs(len(views))
    poses = np.stack([view.world_from_camera for view in views])
    centers, ahead = poses[:, :, 3], poses[:, :, 2]
    distance = np.linalg.norm(centers[:, None] - centers, axis=-1)
    distance[ahead @ ahead.T < np.cos(np.radians(_WIDEST_DEG))] = np.inf
    np.fill_diagonal(distance, np.inf)
    nearest = np.argsort(distance, axis=1)[:, :NEIGHBOURS]
    pairs = {
        (min(i, int(j)), max(i, int(j)))
        for i, row in enumerate(nearest)
        for j in row
        if np.isfinite(distance[i, j])
    }
    return sorted(pairs)


def _posed(
    database: Path, images: ColmapImages, views: Sequence[GivenView]
) -> pycolmap.Reconstruction:
    """Returns a model of the database's images at their poses, without points."""
    model = pycolmap.Reconstruction()
    by_file: Mapping[str, GivenView] = dict(zip(images.files, views, strict=True))
    with closing(pycolmap.Database.open(database)) as opened:
        found = opened.read_all_images()
    for number, image in enumerate(found, start=1):
        view = by_file[image.name]
        model.add_camera_with_trivial_rig(_camera(view, images, number))
        image.camera_id = number
        rotation = pycolmap.Rotation3d(view.world_from_camera[:, :3])
        world_from_camera = pycolmap.Rigid3d(rotation, view.world_from_camera[:, 3])
        model.add_image_with_trivial_frame(image, world_from_camera.inverse())
    return model


def _camera(view: GivenView, images: ColmapImages, number: int) -> pycolmap.Camera:
    """Returns the view's lens at the size of the images."""
    lens = view.lens
    camera = pycolmap.Camera(
        model=lens.model, width=lens.width, height=lens.height, params=list(lens.params)
    )
    camera.camera_id = number
    if not camera.verify_params():
        raise InputError(view.file.name, f"has an impossible lens: {lens}", "Check its poses")
    camera.rescale(images.width, images.height)
    return camera
