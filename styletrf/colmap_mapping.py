"""COLMAP's steps on one database: features, matches, and the two mappers.

Features and matches are asked for in portions, which is how their progress is known. (Counting the
rows of the database meanwhile would take a second copy of SQLite in this process, which breaks the
locks of the first: the file comes out malformed.)
"""

import os
from contextlib import closing
from itertools import groupby
from pathlib import Path

from styletrf.colmap import pycolmap
from styletrf.colmap_images import ColmapImages
from styletrf.image_pairs import Pairs
from styletrf.progress import Progress

_IMAGES_A_BLOCK = 8


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
    *,
    each_its_lens: bool = False,
) -> None:
    """Fills the database with the images, one camera for all or each its own, and SIFT features.

    The one camera starts from the images' focal prior, or from COLMAP's guess where there is none.
    """
    options = pycolmap.FeatureExtractionOptions(use_gpu=False)
    options.sift.max_num_features = max_features
    reader = pycolmap.ImageReaderOptions(camera_model=camera_model)
    modes = pycolmap.CameraMode
    portion = 2 * (os.cpu_count() or 1)
    for done in range(0, len(images.files), portion):
        progress(done, len(images.files))
        pycolmap.extract_features(
            database,
            images.folder,
            list(images.files[done : done + portion]),
            camera_mode=modes.PER_IMAGE if each_its_lens else modes.SINGLE,
            reader_options=reader,
            extraction_options=options,
            device=pycolmap.Device.cpu,
        )
        if done == 0 and not each_its_lens:
            reader.existing_camera_id = _first_camera(database, images.focal_prior_px)
    progress(len(images.files), len(images.files))


def _first_camera(database: Path, focal_px: float | None) -> int:
    """Returns the id of the one camera, after setting its focal length where it is known."""
    with closing(pycolmap.Database.open(database)) as opened:
        (camera,) = opened.read_all_cameras()
        if focal_px is not None:
            params = list(camera.params)
            for index in camera.focal_length_idxs():
                params[index] = focal_px
            camera.params = params
            camera.has_prior_focal_length = True
            opened.update_camera(camera)
        return int(camera.camera_id)


def match_pairs(
    database: Path, images: ColmapImages, pairs: Pairs, seed: int, progress: Progress
) -> int:
    """Matches pairs of images; returns how many verified pairs the database then holds.

    A pair is verified when at least 15 matches agree with one epipolar geometry or homography.
    """
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
            pycolmap.FeatureMatchingOptions(use_gpu=False),
            pycolmap.ImportedPairingOptions(match_list_path=listed),
            verification,
            device=pycolmap.Device.cpu,
        )
        done += len(block)
    progress(len(pairs), len(pairs))
    with closing(pycolmap.Database.open(database)) as opened:
        _, inliers = opened.read_two_view_geometry_num_inliers()
        return sum(count > 0 for count in inliers)  # COLMAP's own count includes failed pairs


def map_globally(
    database: Path, images: ColmapImages, seed: int, progress: Progress
) -> list[pycolmap.Reconstruction]:
    """Returns the models that COLMAP's global mapper finds, the largest first.

    It solves all rotations, then all positions, then adjusts the bundle: fast, and stable where
    the photographs overlap well. It does not tell how far it is.
    """
    options = pycolmap.GlobalPipelineOptions(random_seed=seed)
    progress(0, len(images.files))
    models = pycolmap.global_mapping(database, images.folder, _output(database), options)
    progress(len(images.files), len(images.files))
    return _largest_first(models)


def map_incrementally(
    database: Path, images: ColmapImages, seed: int, progress: Progress
) -> list[pycolmap.Reconstruction]:
    """Returns the models that COLMAP's incremental mapper finds, the largest first.

    It adds one photograph after another: slower, and less choosy about overlap.
    """
    options = pycolmap.IncrementalPipelineOptions(random_seed=seed, min_model_size=3)
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
    return _largest_first(models)


def _output(database: Path) -> Path:
    folder = database.with_suffix(".models")
    folder.mkdir(exist_ok=True)
    return folder


def _largest_first(models: dict[int, pycolmap.Reconstruction]) -> list[pycolmap.Reconstruction]:
    return sorted(
        models.values(), key=lambda m: (-m.num_reg_images(), m.compute_mean_reprojection_error())
    )


def _blocks(pairs: Pairs) -> list[Pairs]:
    """Returns the pairs grouped so that each group concerns few images: all are read for each."""

    def block(pair: tuple[int, int]) -> tuple[int, int]:
        return pair[0] // _IMAGES_A_BLOCK, pair[1] // _IMAGES_A_BLOCK

    return [list(group) for _, group in groupby(sorted(pairs, key=block), key=block)]
