"""Gives each photograph a lens of its own, where nothing says that several share one."""

from collections.abc import Mapping, Set
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from styletrf.colmap import pycolmap
from styletrf.sfm.colmap_features import image_ids
from styletrf.sfm.colmap_images import ColmapImages
from styletrf.sfm.colmap_rigs import write_rigs
from styletrf.sfm.lens_settings import LensSetting
from styletrf.sfm.matching.image_pairs import Pairs

_MATTERS = 0.01  # of a focal length: a larger difference bends the poses
_CERTAIN = 5  # standard errors
_APART = 3  # times as far as photographs with EXIF usually are from each other
_SOME = 0.1  # of the photographs: fewer may as well be misplaced
_FEWEST_POINTS = 30  # of a photograph, to speak of its focal length
_ROBUST = 1.345  # standard deviations, beyond which an error counts for less (Huber)
_REWEIGHTED = 3  # times
_STEP = 1e-5  # of the differences that stand for derivatives

Points = Float[np.ndarray, "points 3"]
Pixels = Float[np.ndarray, "points 2"]


def with_own_lenses(images: ColmapImages) -> ColmapImages:
    """Returns the images with a lens setting for each photograph of which a setting is assumed."""
    settings: list[LensSetting] = []
    for setting in images.lenses:
        known = tuple(file for file in setting.files if file not in setting.assumed)
        settings += [replace(setting, files=known, assumed=())] if known else []
        settings += [LensSetting((file,), None) for file in setting.assumed]
    return replace(images, lenses=tuple(settings))


def give_own_lenses(database: Path, images: ColmapImages) -> Pairs:
    """Gives the image of each lens setting of one image a camera of its own in the database.

    The camera begins as the one that the image shared, of which nothing is known where the setting
    has no focal length. Returns the pairs whose geometry was deleted, since a focal length of
    others decided it: they have to be verified again.
    """
    alone = {setting.files[0]: setting for setting in images.lenses if len(setting.files) == 1}
    unknown = set()
    with closing(pycolmap.Database.open(database)) as opened:
        opened.clear_frames()  # each names the camera of its image
        for image in opened.read_all_images():
            if image.name in alone:
                camera = opened.read_camera(image.camera_id)
                if camera.has_prior_focal_length and alone[image.name].focal_prior_px is None:
                    camera.has_prior_focal_length = False
                    unknown.add(image.image_id)
                image.camera_id = opened.write_camera(camera)
                opened.update_image(image)
        pairs = _forget_geometry(opened, images, unknown)
    write_rigs(database, images)
    return pairs


def _forget_geometry(
    opened: pycolmap.Database, images: ColmapImages, unknown: Set[int]
) -> list[tuple[int, int]]:
    """Deletes the geometry of all pairs of some images, whose matches stay; returns the pairs."""
    index = {number: k for k, number in enumerate(image_ids(opened, images))}
    pairs = []
    for pair_id in opened.read_two_view_geometry_num_inliers()[0]:
        one, other = pycolmap.pair_id_to_image_pair(pair_id)
        if one in unknown or other in unknown:
            opened.delete_two_view_geometry(one, other)
            pairs.append((min(index[one], index[other]), max(index[one], index[other])))
    return pairs


def shared_lenses_differ(model: pycolmap.Reconstruction, images: ColmapImages) -> bool:
    """Returns whether photographs contradict the lens that they are assumed to share.

    A wrong focal length may explain nearly all matches, at poses that it has bent. Then the points
    of a photograph fit best with another focal length than those of the photographs whose EXIF
    names one, or of most where none does: by more than 1 %, than five times its standard error, and
    than three times how far those with EXIF differ. A tenth of the photographs has to differ so.
    """
    image_of = {model.image(number).name: model.image(number) for number in model.reg_image_ids()}
    return any(_differ(model, setting, image_of) for setting in images.lenses if setting.assumed)


def _differ(
    model: pycolmap.Reconstruction, setting: LensSetting, image_of: Mapping[str, pycolmap.Image]
) -> bool:
    placed = [file for file in setting.files if file in image_of]
    found = {
        file: best for file in placed if (best := _best_focal_of(model, image_of[file])) is not None
    }
    if not found:
        return False
    known = [found[file][0] for file in found if file not in setting.assumed]
    usual = np.median(known or [ratio for ratio, _ in found.values()])
    spread = np.median(np.abs(np.subtract(known, usual))) if known else 0.0
    certain = max(_MATTERS, _APART * float(spread))
    others = [
        file
        for file, (ratio, error) in found.items()
        if file in setting.assumed and abs(ratio - usual) > max(certain, _CERTAIN * error)
    ]
    return len(others) >= max(_SOME * len(placed), 1)


def _best_focal_of(
    model: pycolmap.Reconstruction, image: pycolmap.Image
) -> tuple[float, float] | None:
    """Returns the logarithm of an image's best focal length over that of its lens, and its error.

    The image may move, and the points stay. None where it sees too few.
    """
    seen = image.get_observation_points2D()
    if len(seen) < _FEWEST_POINTS:
        return None
    xyz = np.array([model.point3D(point.point3D_id).xyz for point in seen])
    pixels = np.array([point.xy for point in seen])
    pose = image.cam_from_world().matrix()
    lens = model.camera(image.camera_id)
    return _best_focal(lens, xyz @ pose[:, :3].T + pose[:, 3], pixels)


def _best_focal(
    lens: pycolmap.Camera, points: Points, pixels: Pixels
) -> tuple[float, float] | None:
    """Returns the logarithm of the best focal length over that of the lens, and its error.

    Takes one Gauss-Newton step with robust errors, of points in the camera's frame.
    """
    slopes = np.stack(_pixel_slopes(lens, points), axis=-1).reshape(-1, 7)
    errors = (pixels - lens.img_from_cam(points)).reshape(-1)
    counts = np.isfinite(errors) & np.isfinite(slopes).all(axis=1)
    slopes, errors = slopes[counts], errors[counts]
    step, covariance = np.zeros(7), np.eye(7)
    try:
        for _ in range(_REWEIGHTED):
            step, covariance = _reweighted(slopes, errors, step)
    except np.linalg.LinAlgError:  # as of points on one line
        return None
    if not (np.isfinite(step[6]) and covariance[6, 6] > 0):  # as of a plane seen head-on
        return None
    return float(step[6]), float(np.sqrt(covariance[6, 6]))


def _reweighted(
    slopes: Float[np.ndarray, "errors 7"],
    errors: Float[np.ndarray, " errors"],
    step: Float[np.ndarray, " 7"],
) -> tuple[Float[np.ndarray, " 7"], Float[np.ndarray, "7 7"]]:
    """Returns the least-squares step whose weights are by the errors that the last one leaves.

    The second is its covariance, by the spread of these errors.

    Raises:
        numpy.linalg.LinAlgError: The errors do not decide it.
    """
    rest = np.abs(errors - slopes @ step)
    spread = 1.4826 * np.median(rest) + 1e-9
    weighted = slopes * np.minimum(1, _ROBUST * spread / (rest + 1e-12))[:, None]
    inverse = np.linalg.inv(weighted.T @ slopes)
    return inverse @ (weighted.T @ errors), spread**2 * inverse


def _pixel_slopes(lens: pycolmap.Camera, points: Points) -> list[Pixels]:
    """Returns the derivatives of pixels by turns and moves of the camera, and by log focal."""
    away = float(np.median(points[:, 2]))
    axes = _STEP * np.eye(3)
    changes = [np.cross(axis, points) for axis in axes] + [away * axis for axis in axes]
    slopes = [
        (lens.img_from_cam(points + change) - lens.img_from_cam(points - change)) / (2 * _STEP)
        for change in changes
    ]
    longer, shorter = (_zoomed(lens, 1 + step) for step in (_STEP, -_STEP))
    by_focal = longer.img_from_cam(points) - shorter.img_from_cam(points)
    return [*slopes, by_focal / (2 * _STEP)]


def _zoomed(lens: pycolmap.Camera, zoom: float) -> pycolmap.Camera:
    """Returns the lens with its focal lengths times a zoom."""
    params = np.array(lens.params)
    params[list(lens.focal_length_idxs())] *= zoom
    return pycolmap.Camera(
        model=lens.model_name, width=lens.width, height=lens.height, params=params
    )
