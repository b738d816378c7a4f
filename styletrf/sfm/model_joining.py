"""Joins several models of one place that share photographs.

Each is brought into the largest model's frame by the similarity with which the photographs that
both hold agree (as hierarchical mapping does; Bhowmick et al. 2014). Then all points are
triangulated again from the matches, and everything is adjusted together.
"""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from styletrf.colmap import pycolmap
from styletrf.sfm.mapping import SfmResult, explained_fraction

_FEWEST_SHARED = 2  # photographs that determine a similarity
_LARGEST_ERROR_PX, _LEAST_ANGLE_DEG = 4.0, 1.5  # of a point, as COLMAP's mapper has them


def joined(database: Path, mapping: SfmResult, fewest_views: int, seed: int) -> SfmResult:
    """Returns the mapping with the models that share photographs with the first joined to it.

    Returns the mapping unchanged where none does, or none agrees with the first; also where there
    are panoramas, whose views would come apart.
    """
    if len(mapping.models) < 2 or _has_panoramas(mapping.models[0]):
        return mapping
    pycolmap.set_random_seed(seed)  # the similarities' RANSAC takes no seed of its own
    poses = dict(_poses(mapping.models[0]))
    cameras = dict(mapping.models[0].cameras)
    apart = []
    for model in mapping.models[1:]:
        moved = _moved(model, mapping.models[0])
        if moved is None:
            apart.append(model)
        else:
            poses = dict(_poses(moved)) | poses
            cameras = dict(moved.cameras) | cameras
    if len(apart) == len(mapping.models) - 1:
        return mapping
    whole = _adjusted(database, cameras.values(), poses, fewest_views, seed)
    models = [whole, *apart]
    explained = explained_fraction(database, models)
    mapper = f"{mapping.mapper}, {len(mapping.models) - len(apart)} models joined"
    return replace(mapping, models=models, mapper=mapper, explained=explained)


def _has_panoramas(model: pycolmap.Reconstruction) -> bool:
    """Returns whether some images share a frame, as views of a panorama do."""
    return any(rig.num_sensors() > 1 for rig in model.rigs.values())


def _poses(model: pycolmap.Reconstruction) -> Iterator[tuple[int, pycolmap.Rigid3d]]:
    """Yields the images of a model that have a pose, and their poses, camera from world."""
    for image_id in model.reg_image_ids():
        yield image_id, model.image(image_id).cam_from_world()


def _moved(
    model: pycolmap.Reconstruction, target: pycolmap.Reconstruction
) -> pycolmap.Reconstruction | None:
    """Returns the model in the target's frame; None where they share or agree on too little."""
    shared = set(model.reg_image_ids()) & set(target.reg_image_ids())
    if len(shared) < _FEWEST_SHARED:
        return None
    target_from_model = pycolmap.align_reconstructions_via_reprojections(model, target)
    if target_from_model is None:
        return None
    moved = pycolmap.Reconstruction(model)
    moved.transform(target_from_model)
    return moved


def _adjusted(
    database: Path,
    cameras: Iterable[pycolmap.Camera],
    poses: Mapping[int, pycolmap.Rigid3d],
    fewest_views: int,
    seed: int,
) -> pycolmap.Reconstruction:
    """Returns the model of the database's images at these poses, its points new, all adjusted."""
    posed = pycolmap.Reconstruction()
    for camera in cameras:
        posed.add_camera_with_trivial_rig(camera)
    with closing(pycolmap.Database.open(database)) as opened:
        for image in opened.read_all_images():
            if image.image_id in poses:
                posed.add_image_with_trivial_frame(image, poses[image.image_id])
    options = pycolmap.IncrementalPipelineOptions(
        random_seed=seed, num_threads=1, extract_colors=False
    )
    options.triangulation.ignore_two_view_tracks = fewest_views > 2
    folder = database.parent
    whole = pycolmap.triangulate_points(posed, database, folder, folder, options=options)
    adjustment = pycolmap.BundleAdjustmentOptions()
    adjustment.ceres.solver_options.num_threads = 1
    pycolmap.bundle_adjustment(whole, adjustment)
    pycolmap.ObservationManager(whole).filter_all_points3D(_LARGEST_ERROR_PX, _LEAST_ANGLE_DEG)
    whole.update_point_3d_errors()
    return whole
