"""Adjusts poses that came with photographs, where the photographs show that they are off.

Poses and lenses are adjusted by the reprojections of some of the points (bundle adjustment; Triggs
et al. 1999). As many others take no part and judge: the adjusted poses are used where these
points, each placed again, fall nearer to where they are seen. So exact poses, as of a rendered
scene, stay as they are, and a lens whose distortion the poses' format leaves out is found.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from styletrf.colmap import pycolmap
from styletrf.sfm.mapping import ENOUGH_EXPLAINED, explained_fraction

_LARGEST_ERROR_PX, _LEAST_ANGLE_DEG = 4.0, 1.5  # of a point, as COLMAP's mapper has them
_ANGLE_ERROR_DEG = 2.0  # of a new point's rays, likewise
_ROUGH_FRACTION = 0.03  # of the longer side: the largest error of points at poses that are far off
_USUAL_ERROR_PX = 0.5  # of a right match; those of larger ones count for less
_POINTS_PER_IMAGE = 300  # that adjust or judge, at most; more take longer, and agree with them
_LEAST_GAIN = 0.02  # by which the error of points that take no part has to fall
_SAME_FOCAL = 1e-3  # by which the two focal lengths of a pinhole may differ, as a ratio


@dataclass(frozen=True, slots=True)
class AdjustedPoses:
    """The model at the poses that are used, and the reason for these poses."""

    model: pycolmap.Reconstruction
    reason: str


def triangulated(
    posed: pycolmap.Reconstruction,
    database: Path,
    folder: Path,
    seed: int,
    largest_error_px: float = _LARGEST_ERROR_PX,
    fewest_views: int = 3,
) -> pycolmap.Reconstruction:
    """Returns a model of the database's matches at the poses of `posed`, which stay as they are.

    Args:
        posed: The images' poses and lenses.
        database: The COLMAP database, with verified matches.
        folder: The folder of the images.
        seed: Decides COLMAP's sampling.
        largest_error_px: By which a point may miss where it is seen.
        fewest_views: In which a point has to be matched, 2 or 3.
    """
    rough = largest_error_px / _LARGEST_ERROR_PX
    options = pycolmap.IncrementalPipelineOptions(random_seed=seed, num_threads=1)
    options.mapper.filter_max_reproj_error = largest_error_px
    points = options.triangulation
    points.ignore_two_view_tracks = fewest_views > 2
    points.complete_max_reproj_error = points.merge_max_reproj_error = largest_error_px
    points.create_max_angle_error = points.continue_max_angle_error = rough * _ANGLE_ERROR_DEG
    model = pycolmap.Reconstruction(posed)  # COLMAP changes the one that it is given
    return pycolmap.triangulate_points(model, database, folder, database.parent, options=options)


def adjusted_poses(
    given: pycolmap.Reconstruction, database: Path, folder: Path, long_side: int, seed: int
) -> AdjustedPoses:
    """Returns the model at the given poses, or at adjusted ones where these are better.

    Poses that explain few of the matches are first adjusted to points that may miss by 3 % of the
    image. The adjusted model is in the frame of the given poses: the similarity that brings its
    cameras nearest to theirs has been taken out.

    Args:
        given: The model at the given poses, see `triangulated`.
        database: The COLMAP database, with verified matches.
        folder: The folder of the images.
        long_side: The longer side of the images, in pixels.
        seed: Decides COLMAP's sampling.
    """
    reasons, start = ["the poses came with the photographs"], given
    explained = explained_fraction(database, [given])
    if explained < ENOUGH_EXPLAINED:
        rough = triangulated(given, database, folder, seed, _ROUGH_FRACTION * long_side)
        _adjust(rough, with_lenses=False)
        start = triangulated(rough, database, folder, seed)
        better = explained_fraction(database, [start])
        if better < ENOUGH_EXPLAINED:
            return AdjustedPoses(given, reasons[0])
        reasons.append(f"adjusted, they explain {better:.0%} of the matches, not {explained:.0%}")
    trial, before, after = _adjusted_by_half(start)
    if after <= (1 - _LEAST_GAIN) * before:
        start = _with_cameras_of(trial, start)
        _adjust(start, with_lenses=False, with_poses=False)
        observed = pycolmap.ObservationManager(start)
        observed.filter_all_points3D(_LARGEST_ERROR_PX, _LEAST_ANGLE_DEG)
        start.update_point_3d_errors()
        where = f"{after:.2f} px from where they are seen, not {before:.2f} px"
        reasons.append(f"adjusted by half of the points, the other half is {where}")
    if start is not given:
        start.transform(_similarity(given, start))
    return AdjustedPoses(start, "; ".join(reasons))


def _adjusted_by_half(
    start: pycolmap.Reconstruction,
) -> tuple[pycolmap.Reconstruction, float, float]:
    """Returns the model adjusted by half of the points, and the others' errors before and after."""
    points = sorted(start.point3D_ids())
    most = max(1, _POINTS_PER_IMAGE * start.num_reg_images())
    points = points[:: max(1, -(-len(points) // most))]
    judging = _with_points(start, points[1::2])
    before = _error_px(judging)
    trial = _with_points(start, points[::2])
    for camera in trial.cameras.values():
        _with_distortion(camera)
    _adjust(trial, with_lenses=True)
    return trial, before, _error_px(_with_cameras_of(trial, judging))


def _with_points(model: pycolmap.Reconstruction, points: Sequence[int]) -> pycolmap.Reconstruction:
    """Returns the model with these points alone."""
    some = pycolmap.Reconstruction(model)
    for point in set(model.point3D_ids()) - set(points):
        some.delete_point3D(point)
    return some


def _with_cameras_of(
    adjusted: pycolmap.Reconstruction, model: pycolmap.Reconstruction
) -> pycolmap.Reconstruction:
    """Returns the model with the lenses and poses of another, and its own points."""
    moved = pycolmap.Reconstruction(model)
    for number, camera in adjusted.cameras.items():
        moved.cameras[number].model = camera.model
        moved.cameras[number].params = camera.params
    for number in adjusted.reg_frame_ids():
        moved.frames[number].rig_from_world = adjusted.frames[number].rig_from_world
    return moved


def _adjust(
    model: pycolmap.Reconstruction,
    *,
    with_lenses: bool,
    with_poses: bool = True,
) -> None:
    """Adjusts the points of a model, with its poses and lenses or without.

    Errors count by Cauchy's loss: by their squares, the few that are wrong matches would decide.
    """
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_focal_length = options.refine_extra_params = with_lenses
    options.refine_rig_from_world = with_poses
    options.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
    options.ceres.loss_function_scale = _USUAL_ERROR_PX
    options.ceres.solver_options.num_threads = 1  # else sums differ from run to run
    pycolmap.bundle_adjustment(model, options)


def _with_distortion(camera: pycolmap.Camera) -> None:
    """Gives a pinhole the coefficients of a distortion, all 0; other lenses stay as they are."""
    if camera.model not in (pycolmap.CameraModelId.PINHOLE, pycolmap.CameraModelId.SIMPLE_PINHOLE):
        return
    fx, fy = camera.focal_length_x, camera.focal_length_y
    cx, cy = camera.principal_point_x, camera.principal_point_y
    if abs(fx / fy - 1) <= _SAME_FOCAL:
        camera.model = pycolmap.CameraModelId.SIMPLE_RADIAL
        camera.params = [(fx + fy) / 2, cx, cy, 0.0]
    else:
        camera.model = pycolmap.CameraModelId.OPENCV
        camera.params = [fx, fy, cx, cy, 0.0, 0.0, 0.0, 0.0]


def _error_px(model: pycolmap.Reconstruction) -> float:
    """Returns the median over points of their mean distance in pixels from where they are seen.

    Each point is first placed again at the poses of the model.
    """
    placed = pycolmap.Reconstruction(model)
    _adjust(placed, with_lenses=False, with_poses=False)
    placed.update_point_3d_errors()
    return float(np.median([point.error for point in placed.points3D.values()]))


def _similarity(target: pycolmap.Reconstruction, model: pycolmap.Reconstruction) -> pycolmap.Sim3d:
    """Returns the similarity that brings a model's cameras nearest to those of a target.

    Each counts by its center and by points along its axes, so that cameras on a line do as well.
    """
    found = pycolmap.estimate_sim3d(_axes(model), _axes(target))
    return pycolmap.Sim3d() if found is None else found


def _axes(model: pycolmap.Reconstruction) -> Float[np.ndarray, "points 3"]:
    """Returns the centers of the cameras, and points along the axes as far off as these spread."""
    poses = [model.image(i).cam_from_world().inverse() for i in sorted(model.reg_image_ids())]
    centers = np.array([pose.translation for pose in poses])
    reach = np.linalg.norm(np.ptp(centers, axis=0))
    axes = np.array([pose.rotation.matrix().T for pose in poses])
    along = centers[:, None] + reach * axes
    return np.concatenate([centers, along.reshape(-1, 3)])
