"""Structure from motion: where each photograph was taken from, and the points they share.

Features are OpenCV's, matches are exact; geometry and reconstruction are COLMAP's (Schönberger and
Frahm 2016; its global mapper: Pan et al. 2024), with one lens for all photographs of a size, clip
and focal length. Where poses came with them, only the points are sought. The results are
undistorted: pinhole cameras and the images that they would have taken.
"""

import json
import logging
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

from styletrf.capture.capture_file import Capture, read_capture
from styletrf.capture.masks import MASKS
from styletrf.capture.photographs import read_photograph
from styletrf.capture.poses.given_poses import GivenView
from styletrf.capture.scene_capture import given_views
from styletrf.capture.views import held_out_names
from styletrf.colmap import pycolmap
from styletrf.configuration import SEEDS, require_at_least, require_within
from styletrf.files.images import write_png
from styletrf.geometry.camera_table import write_cameras
from styletrf.geometry.cameras import Camera
from styletrf.geometry.parallax import LEAST_PARALLAX, parallax_fraction
from styletrf.geometry.point_table import write_points
from styletrf.geometry.undistortion import undistorted_image
from styletrf.progress import Progress, silent
from styletrf.sfm.colmap_features import extract_features, extract_stronger_features
from styletrf.sfm.colmap_images import ColmapImages, prepare_images
from styletrf.sfm.colmap_mapping import log_to
from styletrf.sfm.known_poses import map_known_poses, with_given_lenses
from styletrf.sfm.lens_settings import Lenses
from styletrf.sfm.mapping import SfmResult, flat_fraction, require_enough, require_explained
from styletrf.sfm.mapping_choice import MappingTask, reconstruct
from styletrf.sfm.own_lenses import with_own_lenses
from styletrf.sfm.poses_report import FLAT, PosesReport, poses_report
from styletrf.sfm.reconstruction import PlacedPhotograph, placed_photographs, sparse_points

_LOGGER = logging.getLogger(__name__)
_CAMERA_MODELS = pycolmap.CameraModelId.__members__.keys() - {"INVALID", "EQUIRECTANGULAR"}
GivenViews = tuple[str, dict[str, GivenView]]
"""Where the poses that came with a capture are from, and its views by name."""


@dataclass(frozen=True, slots=True)
class CameraPosesConfig:
    """Settings of the search for camera poses.

    Args:
        poses: Poses that came with the photographs are adjusted where these say so (`auto`), stay
            as they are (`given`), or are ignored but for the split that came with them (`solved`).
        max_image_long_side: Larger photographs are worked on, and undistorted, at this size.
        max_features: The most SIFT features of one photograph, of which the largest are kept.
        video_features: The same of one frame of a video.
        tracks: How many of them decide where a photograph is; the others add points.
        exhaustive_up_to: Up to so many photographs, all pairs are matched.
        preemptive_up_to: Up to so many, each is matched with those that share the most matches of
            a few features with it; beyond, sequences are matched along their order and with those
            that look alike, and others with the latter.
        neighbors: How many others each photograph is matched with: those that share the most
            matches; or, in a sequence, its successors and as many that look most like it; or else
            twice as many that look most like it.
        video_neighbors: The same for frames of videos, which are an even travel apart.
        camera_model: COLMAP's name of the lens model.
        lenses: `one` for all photographs of a size, one for `each`, or (`auto`) one for those of a
            clip, or of a size and of a focal length by their EXIF.
        least_explained: The command stops where poses that were solved explain a smaller fraction
            of what the photographs share; 0 for never.
        seed: Decides the samples of RANSAC and of the mappers.
    """

    poses: Literal["auto", "given", "solved"] = "auto"
    max_image_long_side: int = 1600
    max_features: int = 4096
    video_features: int = 1536
    tracks: int = 300
    exhaustive_up_to: int = 16
    preemptive_up_to: int = 150
    neighbors: int = 12
    video_neighbors: int = 4
    camera_model: str = "SIMPLE_RADIAL"
    lenses: Lenses = "auto"
    least_explained: float = 0.5
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.least_explained <= 1:
            raise ValueError(
                f"least_explained is a fraction from 0 to 1, not {self.least_explained:g}"
            )
        require_within(SEEDS, self, "seed")
        require_at_least(1, self, "max_image_long_side", "max_features", "video_features")
        require_at_least(1, self, "tracks", "neighbors", "video_neighbors")
        require_at_least(0, self, "exhaustive_up_to", "preemptive_up_to")
        if self.camera_model not in _CAMERA_MODELS:
            known = ", ".join(sorted(_CAMERA_MODELS))
            raise ValueError(f"camera_model is {self.camera_model!r}, and COLMAP has {known}")


def solve_camera_poses(
    capture_dir: Path,
    out_dir: Path,
    config: CameraPosesConfig,
    progress: Progress = silent,
    log_dir: Path | None = None,
    scratch_dir: Path | None = None,
) -> PosesReport:
    """Finds the cameras of a capture and writes them, their points and undistorted images.

    `out_dir` receives `cameras.parquet` (the registered photographs in the capture's order, then
    the names of the others), `points.parquet`, `images/<name>.png`, `masks/<name>.png` of those
    that have one, and, last, `poses.json`. The world is COLMAP's: its origin, axes and scale mean
    nothing.

    Args:
        capture_dir: The folder that `capture_photographs` wrote.
        out_dir: The folder to write to.
        config: See `CameraPosesConfig`.
        progress: Called phase by phase: photographs read, described, pairs matched, photographs
            placed, undistorted.
        log_dir: The folder for COLMAP's messages, which go to standard error where it is None.
        scratch_dir: The folder in which COLMAP works; the system's temporary folder where it is
            None.

    Raises:
        InputError: The photographs do not overlap, fewer than three can be placed, or the poses
            explain less of their matches than `least_explained`.
    """
    if log_dir is not None:
        log_to(log_dir)
    pycolmap.set_random_seed(config.seed)
    capture = read_capture(capture_dir)
    published = given_views(capture_dir)
    given = published if config.poses != "solved" else None
    with TemporaryDirectory(
        prefix="colmap-", dir=scratch_dir, ignore_cleanup_errors=True
    ) as scratch:
        found = _solve(capture_dir, capture, given, config, Path(scratch), progress)
        _write_undistorted(out_dir, found.images, found.placed, progress)
    cameras = [one.camera for one in found.placed]
    points = sparse_points(found.mapping.models[0], found.placed)
    report = poses_report(
        found.images, capture.photographs, found.mapping, found.placed, found.flat,
        has_parallax=found.flat < FLAT or parallax_fraction(points, cameras) >= LEAST_PARALLAX,
        is_given=given is not None,
    )  # fmt: skip
    held_out = _held_out(capture, cameras, published)
    write_cameras(out_dir / "cameras.parquet", cameras, report.unregistered, held_out)
    write_points(out_dir / "points.parquet", points)
    _write_report(out_dir / "poses.json", report)
    return report


@dataclass(frozen=True, slots=True)
class _Solution:
    """The result of COLMAP: `flat` is the fraction of flat pairs, 0 of poses that were given."""

    images: ColmapImages
    mapping: SfmResult
    flat: float
    placed: list[PlacedPhotograph]


def _solve(
    capture_dir: Path,
    capture: Capture,
    given: GivenViews | None,
    config: CameraPosesConfig,
    scratch: Path,
    progress: Progress,
) -> _Solution:
    """Returns the photographs as COLMAP places them; `scratch` receives its images and database."""
    lenses, long_side = "each" if given else config.lenses, config.max_image_long_side
    folder, database = scratch / "images", scratch / "colmap.db"
    images = prepare_images(capture_dir, capture, folder, long_side, lenses, progress)
    names = [photograph.name for photograph in capture.photographs]
    if given:
        images = with_given_lenses(images, [given[1][name] for name in names])
        mapping, flat = _from_given(database, images, names, given, config, progress), 0.0
    else:
        mapping = _from_matches(database, images, capture, config, progress)
        flat = flat_fraction(database)
        images = with_own_lenses(images) if mapping.has_own_lenses else images
    mapping.models[0].extract_colors_for_all_images(images.folder)
    files = dict(zip(images.files, names, strict=True))
    return _Solution(images, mapping, flat, placed_photographs(mapping.models[0], files))


def _from_given(
    database: Path,
    images: ColmapImages,
    names: Sequence[str],
    given: GivenViews,
    config: CameraPosesConfig,
    progress: Progress,
) -> SfmResult:
    """Returns a mapping at the poses that came with the photographs, or near them."""
    source, views = given
    may_adjust = config.poses == "auto"
    return map_known_poses(
        database, images, [views[name] for name in names], source, config.max_features,
        config.seed, progress, may_adjust=may_adjust,
    )  # fmt: skip


def _from_matches(
    database: Path,
    images: ColmapImages,
    capture: Capture,
    config: CameraPosesConfig,
    progress: Progress,
) -> SfmResult:
    """Returns a mapping of at least three photographs."""
    is_video = all(photograph.clip is not None for photograph in capture.photographs)
    most = config.video_features if is_video else config.max_features
    extract_features(database, images, config.camera_model, most, progress)
    mapping = reconstruct(
        MappingTask(
            database,
            images,
            capture.photographs,
            config.exhaustive_up_to,
            config.preemptive_up_to,
            config.video_neighbors if is_video else config.neighbors,
            config.seed,
            progress,
            config.tracks,
            lambda path: extract_stronger_features(
                path, images, config.camera_model, most, progress
            ),
        )
    )
    require_enough(mapping, capture.photographs)
    require_explained(mapping, capture.photographs, config.least_explained)
    return mapping


def _write_undistorted(
    out_dir: Path, images: ColmapImages, placed: Sequence[PlacedPhotograph], progress: Progress
) -> None:
    for folder in ("images", MASKS):
        (out_dir / folder).mkdir(parents=True, exist_ok=True)

    def write(one: PlacedPhotograph) -> None:
        sources = {"images": images.folder / one.file, MASKS: images.mask_of(one.file)}
        for folder, source in sources.items():
            if source is not None:
                pinhole = undistorted_image(read_photograph(source), one.lens, one.camera)
                write_png(out_dir / folder / f"{one.camera.name}.png", pinhole, compression=3)

    progress(0, len(placed))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for done, _ in enumerate(pool.map(write, placed), start=1):
            progress(done, len(placed))


def _held_out(capture: Capture, cameras: Sequence[Camera], given: GivenViews | None) -> set[str]:
    """Returns the names of the views to measure by; those of one panorama are held out together."""
    panoramas = {one.name: one.panorama for one in capture.photographs if one.panorama}
    return held_out_names(cameras, given[1] if given else {}, panoramas)


def _write_report(path: Path, report: PosesReport) -> None:
    """Writes the report as JSON, and logs its warnings."""
    content = {**asdict(report), "warnings": report.warnings}
    content["tells_depth"] = content.pop("has_parallax")  # the key of earlier versions
    text = json.dumps(content, sort_keys=True, indent=1, ensure_ascii=False)
    path.write_text(text + "\n", encoding="utf-8")
    for warning in report.warnings:
        _LOGGER.warning(warning)
