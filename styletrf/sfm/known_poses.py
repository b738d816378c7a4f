"""Sparse points of photographs whose poses are known: described, matched and triangulated.

COLMAP's search for the poses is skipped. They may be adjusted, see
`styletrf.sfm.pose_adjustment`.
"""

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from styletrf.capture.photograph_size import photograph_size
from styletrf.capture.poses.given_poses import GIVEN_BY, GivenView, Lens
from styletrf.colmap import pycolmap
from styletrf.errors import InputError
from styletrf.progress import Progress
from styletrf.sfm.colmap_features import extract_features
from styletrf.sfm.colmap_images import ColmapImages
from styletrf.sfm.colmap_mapping import match_pairs
from styletrf.sfm.lens_settings import LensSetting
from styletrf.sfm.mapping import (
    ENOUGH_EXPLAINED,
    OTHER_POSES,
    SfmResult,
    explained_fraction,
)
from styletrf.sfm.matching.image_pairs import Pairs, all_pairs
from styletrf.sfm.pose_adjustment import adjusted_poses, triangulated

NEIGHBORS = 20
"""With so many each photograph is matched, where there are more; more are many."""
_WIDEST_DEG = 60.0  # between the views of photographs that are matched
_FEWEST_POINTS = 16
_LEAST_FRACTION = 0.3  # of the matched features, that have a point; right poses have 0.9


def map_known_poses(
    database: Path,
    images: ColmapImages,
    views: Sequence[GivenView],
    source: str,
    max_features: int,
    seed: int,
    progress: Progress,
    *,
    may_adjust: bool = True,
) -> SfmResult:
    """Returns the model of images at the given poses, or near them.

    Args:
        database: The COLMAP database to fill.
        images: The images, in the order of `views`, see `with_given_lenses`.
        views: The pose and the lens of each.
        source: The source of the poses, for messages.
        max_features: SIFT features kept of one image.
        seed: Decides the samples of the verification of matches.
        progress: Called for the images described, then for the pairs matched.
        may_adjust: Whether poses and lenses may become better ones than those given.

    Raises:
        InputError: The photographs do not fit the poses, or have lenses of several models.
    """
    lens = _lens_model(views, source)
    extract_features(database, images, lens, max_features, progress)
    posed = _posed(database, images, views)  # before matches are verified with these lenses
    pairs = neighboring_pairs(views)
    verified = match_pairs(database, images, pairs, seed, progress)
    model = triangulated(posed, database, images.folder, seed)
    reason = "the poses came with the photographs"
    if may_adjust:
        found = adjusted_poses(model, database, images.folder, images.long_side, seed)
        model, reason = found.model, found.reason
    _require_fitting(model, database, source)
    explained = explained_by_given(model, database, images.folder, seed)
    return SfmResult([model], "neighbors", verified, f"{GIVEN_BY}{source}", reason, explained)


def explained_by_given(
    model: pycolmap.Reconstruction, database: Path, folder: Path, seed: int
) -> float:
    """Returns the fraction of the matches that given poses explain.

    Of few photographs most points are in two alone. The model leaves these out, and right poses
    explain them. Of many photographs, wrong poses would explain such points as well.

    Args:
        model: The model at the poses, see `triangulated`.
        database: The COLMAP database, with verified matches.
        folder: The folder of the images.
        seed: Decides COLMAP's sampling.
    """
    explained = explained_fraction(database, [model])
    if explained >= ENOUGH_EXPLAINED or model.num_reg_images() > NEIGHBORS:
        return explained
    by_twos = triangulated(model, database, folder, seed, fewest_views=2)
    return explained_fraction(database, [by_twos])


def _lens_model(views: Sequence[GivenView], source: str) -> str:
    """Returns COLMAP's name of the lens model, of which there must be one."""
    lens_models = {view.lens.model for view in views}
    if len(lens_models) > 1:
        problem = f"has lenses of several models: {', '.join(sorted(lens_models))}"
        raise InputError(source, problem, "Export all views with one of them")
    (lens,) = lens_models
    return lens


def _require_fitting(model: pycolmap.Reconstruction, database: Path, source: str) -> None:
    """Refuses poses at which too few of the matched features have a point."""
    fraction = model.compute_num_observations() / max(_matched_features(database), 1)
    if model.num_points3D() < _FEWEST_POINTS or fraction < _LEAST_FRACTION:
        raise InputError(
            source,
            f"does not fit the photographs: at its poses they share {model.num_points3D()} points,"
            f" seen by {fraction:.0%} of the features that match",
            OTHER_POSES,
        )


def neighboring_pairs(views: Sequence[GivenView]) -> Pairs:
    """Returns pairs i < j of views that may show the same: all, or each with its nearest.

    A view's nearest are the 20 with the nearest centers, of those that look the same way within 60
    degrees.
    """
    if len(views) <= 2 * NEIGHBORS:
        return all_pairs(len(views))
    poses = np.stack([view.world_from_camera for view in views])
    centers, ahead = poses[:, :, 3], poses[:, :, 2]
    distance = np.linalg.norm(centers[:, None] - centers, axis=-1)
    distance[ahead @ ahead.T < np.cos(np.radians(_WIDEST_DEG))] = np.inf
    np.fill_diagonal(distance, np.inf)
    nearest = np.argsort(distance, axis=1)[:, :NEIGHBORS]
    pairs = {
        (min(i, int(j)), max(i, int(j)))
        for i, row in enumerate(nearest)
        for j in row
        if np.isfinite(distance[i, j])
    }
    return sorted(pairs)


def with_given_lenses(images: ColmapImages, views: Sequence[GivenView]) -> ColmapImages:
    """Returns the images with a lens setting for each given lens and size of an image."""
    of_lenses: dict[tuple[Lens, tuple[int, int]], list[str]] = {}
    for file, view in zip(images.files, views, strict=True):
        size = photograph_size(images.folder / file)
        of_lenses.setdefault((view.lens, size), []).append(file)
    lenses = tuple(LensSetting(tuple(same), None) for same in of_lenses.values())
    return replace(images, lenses=lenses)


def _matched_features(database: Path) -> int:
    """Returns how many features have a verified match."""
    with closing(pycolmap.Database.open(database)) as opened:
        pairs, geometries = opened.read_two_view_geometries()
    found = set()
    for pair, geometry in zip(pairs, geometries, strict=True):
        for image, feature in zip(
            pycolmap.pair_id_to_image_pair(pair), geometry.inlier_matches.T, strict=True
        ):
            found |= {(image, int(index)) for index in feature}
    return len(found)


def _posed(
    database: Path, images: ColmapImages, views: Sequence[GivenView]
) -> pycolmap.Reconstruction:
    """Returns a model of the database's images at their poses, without points.

    The cameras of the database receive the given lenses.
    """
    model = pycolmap.Reconstruction()
    by_file: Mapping[str, GivenView] = dict(zip(images.files, views, strict=True))
    with closing(pycolmap.Database.open(database)) as opened:
        for image in opened.read_all_images():
            view = by_file[image.name]
            if image.camera_id not in model.cameras:
                camera = _with_lens(opened.read_camera(image.camera_id), view.lens)
                opened.update_camera(camera)
                model.add_camera_with_trivial_rig(camera)
            rotation = pycolmap.Rotation3d(view.world_from_camera[:, :3])
            world_from_camera = pycolmap.Rigid3d(rotation, view.world_from_camera[:, 3])
            model.add_image_with_trivial_frame(image, world_from_camera.inverse())
    return model


def _with_lens(camera: pycolmap.Camera, lens: Lens) -> pycolmap.Camera:
    """Returns the camera with a lens, brought to its size."""
    width, height = camera.width, camera.height
    camera.width, camera.height, camera.params = lens.width, lens.height, list(lens.params)
    if (width - height) * (lens.width - lens.height) < 0:
        _turn(camera)
    camera.rescale(width, height)
    camera.has_prior_focal_length = True
    return camera


def _turn(camera: pycolmap.Camera) -> None:
    """Turns a lens by a quarter, about its center: which way is not known.

    The lens is given for photographs in landscape format, and took one in portrait format, or vice
    versa.
    """
    camera.width, camera.height = camera.height, camera.width
    params = list(camera.params)
    focals = [params[index] for index in camera.focal_length_idxs()]
    for index, focal in zip(camera.focal_length_idxs(), reversed(focals), strict=True):
        params[index] = focal
    camera.params = params
    camera.principal_point_x, camera.principal_point_y = camera.width / 2, camera.height / 2
