"""COLMAP's steps on one database: features, matches, and the two mappers.

Features and matches are asked for in portions, which is how their progress is known. (Counting the
rows of the database meanwhile would take a second copy of SQLite in this process, which breaks the
locks of the first: the file comes out malformed.)
"""

import os
from collections.abc import Iterable
from contextlib import closing
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory

from styletrf.colmap import pycolmap
from styletrf.progress import Progress
from styletrf.sfm.colmap_images import ColmapImages, LensSetting
from styletrf.sfm.colmap_rigs import tie_views
from styletrf.sfm.image_pairs import Pairs

_IMAGES_A_BLOCK = 8
_SAMPLED = 4  # images whose features are counted before the others


def log_to(folder: Path) -> None:
    """Sends COLMAP's messages to files in `folder`, and none but fatal ones to standard error.

    The setting is the whole process's, as COLMAP's logging is.
    """
    folder.mkdir(parents=True, exist_ok=True)
    log = pycolmap.logging
    log.logtostderr = log.alsologtostderr = False
    log.stderrthreshold = int(log.FATAL)
    log.set_log_destination(log.INFO, str(folder / "colmap."))


def extract_features(
    database: Path,
    images: ColmapImages,
    camera_model: str,
    max_features: int,
    progress: Progress,
    first_octave: int | None = None,
    *,
    stronger: bool = False,
) -> None:
    """Fills the database with the images, a camera for each lens setting, and SIFT features.

    A camera starts from its setting's focal prior, or from COLMAP's guess where there is none.
    Features of octave 0 on have the size of pixels and more; those of octave -1, found in the
    image at twice its size, half of that. They are looked for where no octave is named, unless
    images have as many features as are kept without them: the largest are kept.
    Features that are `stronger` take several times as long: twice as many, fainter ones too,
    their shape estimated up to an affinity and described at several sizes (Dong and Soatto 2015).
    """
    options = pycolmap.FeatureExtractionOptions(use_gpu=False)
    options.sift.max_num_features = 2 * max_features if stronger else max_features
    if first_octave is None:
        has_enough = not stronger and _fewest_coarse_features(images, max_features) >= max_features
        first_octave = 0 if has_enough else -1
    options.sift.first_octave = first_octave
    if stronger:
        options.sift.peak_threshold /= 2
        options.sift.estimate_affine_shape = options.sift.domain_size_pooling = True
    reader = pycolmap.ImageReaderOptions()
    if images.masks is not None:
        reader.mask_path = images.masks
    _register(database, images, camera_model)
    tie_views(database, images)
    portion, total = 2 * (os.cpu_count() or 1), len(images.files)
    for start in range(0, total, portion):
        progress(start, total)
        pycolmap.extract_features(
            database,
            images.folder,
            list(images.files[start : start + portion]),
            reader_options=reader,
            extraction_options=options,
            device=pycolmap.Device.cpu,
        )
    for setting in images.lenses:
        if setting.focal_prior_px is not None:
            _set_focal(database, setting.files[0], setting.focal_prior_px)
    progress(total, total)


def _fewest_coarse_features(images: ColmapImages, max_features: int) -> int:
    """Returns the fewest features of octave 0 on that a few images of the capture have."""
    options = pycolmap.FeatureExtractionOptions(use_gpu=False)
    options.sift.max_num_features, options.sift.first_octave = max_features, 0
    few = list(images.files[:: max(1, len(images.files) // _SAMPLED)][:_SAMPLED])
    with TemporaryDirectory(dir=images.folder.parent) as folder:
        database = Path(folder) / "sample.db"
        pycolmap.extract_features(
            database, images.folder, few, extraction_options=options, device=pycolmap.Device.cpu
        )
        with closing(pycolmap.Database.open(database)) as opened:
            sampled = opened.read_all_images()
            return min(opened.num_keypoints_for_image(image.image_id) for image in sampled)


def _register(database: Path, images: ColmapImages, camera_model: str) -> None:
    """Gives images and cameras their numbers, in order.

    The threads that describe images would number them as they come, and what follows (whom RANSAC
    samples first, which pair begins) would differ from run to run.
    """
    pycolmap.Database.open(database).close()
    modes, settings = pycolmap.CameraMode, images.lenses
    each = all(len(setting.files) == 1 and setting.direction is None for setting in settings)
    mode = modes.PER_IMAGE if each else modes.SINGLE
    for setting in [LensSetting(images.files, None)] if each else settings:
        model = camera_model if setting.direction is None else "SIMPLE_PINHOLE"
        reader = pycolmap.ImageReaderOptions(camera_model=model)
        pycolmap.import_images(database, images.folder, mode, list(setting.files), reader)


def _set_focal(database: Path, file: str, focal_px: float) -> None:
    """Sets the known focal length of the camera that took an image."""
    with closing(pycolmap.Database.open(database)) as opened:
        image = next(image for image in opened.read_all_images() if image.name == file)
        camera = opened.read_camera(image.camera_id)
        params = list(camera.params)
        for index in camera.focal_length_idxs():
            params[index] = focal_px
        camera.params = params
        camera.has_prior_focal_length = True
        opened.update_camera(camera)


def match_pairs(
    database: Path,
    images: ColmapImages,
    pairs: Pairs,
    seed: int,
    progress: Progress,
    *,
    guided: bool = False,
) -> int:
    """Matches pairs of images; returns how many verified pairs the database then holds.

    A pair is verified when at least 15 matches agree with one epipolar geometry or homography.
    Where matching is `guided`, it is then repeated along that geometry. A pair that the database
    holds already stays as it is.
    """
    matching = pycolmap.FeatureMatchingOptions(
        use_gpu=False, guided_matching=guided, skip_image_pairs_in_same_frame=True
    )
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = seed
    listed = database.with_suffix(".pairs.txt")
    done = 0
    for block in _blocks(pairs):
        progress(done, len(pairs))
        lines = [f"{images.files[i]} {images.files[j]}\n" for i, j in block]
        listed.write_text("".join(lines), encoding="utf-8")
        pycolmap.match_image_pairs(
            database,
            matching,
            pycolmap.ImportedPairingOptions(match_list_path=listed),
            verification,
            device=pycolmap.Device.cpu,
        )
        done += len(block)
    progress(len(pairs), len(pairs))
    with closing(pycolmap.Database.open(database)) as opened:
        _, inliers = opened.read_two_view_geometry_num_inliers()
        return sum(count > 0 for count in inliers)  # COLMAP's own count includes failed pairs


def match_again(database: Path, images: ColmapImages, seed: int, progress: Progress) -> int:
    """Matches the verified pairs once more, guided by their geometry; returns how many there are.

    Features that look like several others find their match along the epipolar line.
    """
    with closing(pycolmap.Database.open(database)) as opened:
        index = {
            image.image_id: images.files.index(image.name) for image in opened.read_all_images()
        }
        ids, counts = opened.read_two_view_geometry_num_inliers()
        pairs = []
        for pair_id, count in zip(ids, counts, strict=True):
            if count > 0:
                one, other = pycolmap.pair_id_to_image_pair(pair_id)
                opened.delete_two_view_geometry(one, other)
                first, second = sorted((index[one], index[other]))
                pairs.append((first, second))
    return match_pairs(database, images, pairs, seed, progress, guided=True)


def map_globally(
    database: Path,
    images: ColmapImages,
    seed: int,
    progress: Progress,
    fewest_views: int = 3,
    tracks: int | None = None,
) -> list[pycolmap.Reconstruction]:
    """Returns the models that COLMAP's global mapper finds, the largest first.

    It solves all rotations, then all positions, then adjusts the bundle: fast, and stable where
    the photographs overlap well. It does not tell how far it is. One thread, since several add up
    in an order that differs from run to run. Points count that at least `fewest_views` share. With
    `tracks`, only so many of an image decide where it is; the points of the others are added in the
    end.
    """
    options = pycolmap.GlobalPipelineOptions(random_seed=seed, num_threads=1)
    options.mapper.bundle_adjustment.ceres.solver_options.num_threads = 1
    if tracks is not None:
        options.mapper.track_required_tracks_per_view = tracks
    options.mapper.track_min_num_views_per_track = fewest_views
    options.mapper.global_positioning.min_num_view_per_track = fewest_views
    options.mapper.bundle_adjustment.min_track_length = fewest_views
    options.mapper.retriangulation.ignore_two_view_tracks = fewest_views > 2
    for part in (
        options.mapper,
        options.mapper.rotation_averaging,
        options.mapper.global_positioning,
        options.mapper.bundle_adjustment,
    ):
        part.refine_sensor_from_rig = False
    if images.lenses_are_known:
        options.mapper.bundle_adjustment.refine_focal_length = False
    progress(0, len(images.files))
    models = pycolmap.global_mapping(database, images.folder, _output(database), options)
    progress(len(images.files), len(images.files))
    return largest_first(models.values())


def map_incrementally(
    database: Path,
    images: ColmapImages,
    seed: int,
    progress: Progress,
    fewest_views: int = 3,
    *,
    eager: bool = False,
) -> list[pycolmap.Reconstruction]:
    """Returns the models that COLMAP's incremental mapper finds, the largest first.

    It adds one photograph after another: slower, and less choosy about overlap. One thread, too.
    Where it is `eager`, it may begin with a pair of a quarter of the usual angle, and places a
    photograph by half the usual matches.
    """
    options = pycolmap.IncrementalPipelineOptions(random_seed=seed, min_model_size=3, num_threads=1)
    options.triangulation.ignore_two_view_tracks = fewest_views > 2
    options.ba_refine_sensor_from_rig = False
    if images.lenses_are_known:
        options.ba_refine_focal_length = options.mapper.abs_pose_refine_focal_length = False
    if eager:
        options.mapper.init_min_tri_angle /= 4
        options.mapper.init_min_num_inliers //= 2
        options.mapper.abs_pose_min_num_inliers //= 2
    placed, total = 0, len(images.files)

    def place(count: int) -> None:
        nonlocal placed
        placed = min(placed + count, total)
        progress(placed, total)

    models = pycolmap.incremental_mapping(
        database,
        images.folder,
        _output(database),
        options,
        initial_image_pair_callback=lambda: place(2),
        next_image_callback=lambda: place(1),
    )
    progress(total, total)
    return largest_first(models.values())


def _output(database: Path) -> Path:
    folder = database.with_suffix(".models")
    folder.mkdir(exist_ok=True)
    return folder


def largest_first(models: Iterable[pycolmap.Reconstruction]) -> list[pycolmap.Reconstruction]:
    """Returns models by their number of photographs, then by their reprojection error."""
    return sorted(models, key=lambda m: (-m.num_reg_images(), m.compute_mean_reprojection_error()))


def _blocks(pairs: Pairs) -> list[Pairs]:
    """Returns the pairs grouped so that each group concerns few images: all are read for each."""

    def block(pair: tuple[int, int]) -> tuple[int, int]:
        return pair[0] // _IMAGES_A_BLOCK, pair[1] // _IMAGES_A_BLOCK

    return [list(group) for _, group in groupby(sorted(pairs, key=block), key=block)]
