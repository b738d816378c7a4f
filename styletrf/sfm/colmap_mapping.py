"""Matches, and COLMAP's two mappers, on one database."""

from collections import Counter
from collections.abc import Collection, Iterable
from contextlib import closing
from itertools import combinations, groupby
from pathlib import Path

import numpy as np

from styletrf.colmap import pycolmap
from styletrf.progress import Progress
from styletrf.sfm.colmap_features import image_ids, read_descriptors
from styletrf.sfm.colmap_images import ColmapImages
from styletrf.sfm.matching.image_pairs import Pairs, all_pairs, pieces
from styletrf.sfm.matching.mutual_matches import mutual_matches

_VERIFIED_AT_ONCE = 512  # pairs, so that the progress is known


def log_to(folder: Path) -> None:
    """Sends COLMAP's messages to files in `folder`, and none but fatal ones to standard error.

    The setting is the whole process's, as COLMAP's logging is.
    """
    folder.mkdir(parents=True, exist_ok=True)
    log = pycolmap.logging
    log.logtostderr = log.alsologtostderr = False
    log.stderrthreshold = int(log.FATAL)
    log.set_log_destination(log.INFO, str(folder / "colmap."))


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
    holds already stays as it is, and views of one panorama are no pair.
    """
    of_one_panorama = set(panorama_pairs(images))
    pairs = [pair for pair in sorted(pairs) if pair not in of_one_panorama]
    _match(database, images, pairs, progress)
    _verify(database, images, pairs, seed, progress, guided=guided)
    with closing(pycolmap.Database.open(database)) as opened:
        _, inliers = opened.read_two_view_geometry_num_inliers()
        return sum(count > 0 for count in inliers)  # COLMAP's own count includes failed pairs


def panorama_pairs(images: ColmapImages) -> Pairs:
    """Returns the pairs i < j of views of one panorama, whose relative poses are known."""
    index = {file: k for k, file in enumerate(images.files)}
    return [
        (min(index[one], index[other]), max(index[one], index[other]))
        for files in images.panoramas
        for one, other in combinations(files, 2)
    ]


def _match(database: Path, images: ColmapImages, pairs: Pairs, progress: Progress) -> None:
    """Writes the matches of pairs in ascending order into the database, unless it has them."""
    with closing(pycolmap.Database.open(database)) as opened:
        ids = image_ids(opened, images)
        new = [pair for pair in pairs if not opened.exists_matches(ids[pair[0]], ids[pair[1]])]
        matched = sorted({index for pair in new for index in pair})
        descriptors = {index: read_descriptors(opened, ids[index]) for index in matched}
        done = len(pairs) - len(new)
        progress(done, len(pairs))
        for i, group in groupby(new, key=lambda pair: pair[0]):
            others = [j for _, j in group]
            found = mutual_matches(descriptors[i], [descriptors[j] for j in others])
            for j, matches in zip(others, found, strict=True):
                opened.write_matches(ids[i], ids[j], matches.astype(np.uint32))
            done += len(others)
            progress(done, len(pairs))


def _verify(
    database: Path,
    images: ColmapImages,
    pairs: Pairs,
    seed: int,
    progress: Progress,
    *,
    guided: bool,
) -> None:
    """Has COLMAP estimate the geometry of pairs whose matches the database holds."""
    listed = database.with_suffix(".pairs.txt")
    matching = pycolmap.FeatureMatchingOptions(use_gpu=False, guided_matching=guided)
    matching.sift.cpu_brute_force_matcher = True  # guided matching is exact, and needs no index
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = seed
    for start in range(0, len(pairs), _VERIFIED_AT_ONCE):
        progress(start, len(pairs))
        portion = pairs[start : start + _VERIFIED_AT_ONCE]
        lines = [f"{images.files[i]} {images.files[j]}\n" for i, j in portion]
        listed.write_text("".join(lines), encoding="utf-8")
        pycolmap.match_image_pairs(
            database,
            matching,
            pycolmap.ImportedPairingOptions(match_list_path=listed),
            verification,
            device=pycolmap.Device.cpu,
        )
    progress(len(pairs), len(pairs))


def match_again(database: Path, images: ColmapImages, seed: int, progress: Progress) -> int:
    """Matches the verified pairs once more, guided by their geometry; returns how many there are.

    Features that look like several others find their match along the epipolar line.
    """
    with closing(pycolmap.Database.open(database)) as opened:
        ids, pairs = image_ids(opened, images), _verified_pairs(opened, images)
        for i, j in pairs:
            opened.delete_two_view_geometry(ids[i], ids[j])
    return match_pairs(database, images, pairs, seed, progress, guided=True)


def pairs_within_other_pieces(
    database: Path, images: ColmapImages, missing: Collection[int]
) -> Pairs:
    """Returns the pairs i < j of each piece, but not of that of the placed photographs.

    Photographs that verified pairs connect form a piece, such as a burst. More pairs within a piece
    do not connect it with others.

    Args:
        database: Holds the verified pairs.
        images: The photographs.
        missing: The positions of those that are not placed. If none is, the largest piece is left
            out.
    """
    count = len(images.files)
    with closing(pycolmap.Database.open(database)) as opened:
        piece = pieces(count, _verified_pairs(opened, images))
    placed = [piece[k] for k in range(count) if k not in missing]
    [(of_placed, _)] = Counter(placed or piece).most_common(1)
    return [(i, j) for i, j in all_pairs(count) if piece[i] == piece[j] != of_placed]


def _verified_pairs(opened: pycolmap.Database, images: ColmapImages) -> Pairs:
    """Returns the pairs i < j whose matches agree with some geometry."""
    index = {number: k for k, number in enumerate(image_ids(opened, images))}
    rows = zip(*opened.read_two_view_geometry_num_inliers(), strict=True)
    found = (pycolmap.pair_id_to_image_pair(pair_id) for pair_id, inliers in rows if inliers > 0)
    positions = ((index[one], index[other]) for one, other in found)
    return [(min(pair), max(pair)) for pair in positions]


def map_globally(
    database: Path,
    images: ColmapImages,
    seed: int,
    progress: Progress,
    fewest_views: int = 3,
    tracks: int | None = None,
) -> list[pycolmap.Reconstruction]:
    """Returns the models that COLMAP's global mapper finds, the largest first.

    The mapper solves all rotations, then all positions, then adjusts the bundle: it is fast, and
    stable where the photographs overlap well. It reports no progress. It runs in one thread, since
    several add up in an order that differs from run to run. Points count that at least
    `fewest_views` share. With `tracks`, only so many features of an image decide its pose; the
    points of the others are added in the end.
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

    The mapper adds one photograph after another: it is slower, and needs less overlap. It runs in
    one thread, too. Where it is `eager`, it may begin with a pair of a quarter of the usual angle,
    and places a photograph by half the usual matches.
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
