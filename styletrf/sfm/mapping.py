"""The result of a mapper, and how well it explains the matches of the photographs."""

from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from styletrf.capture.capture_file import Photograph
from styletrf.capture.photographs import FEWEST_PHOTOGRAPHS
from styletrf.colmap import pycolmap
from styletrf.errors import InputError

ENOUGH_EXPLAINED = 0.8
_LEAST_INLIERS = 30  # of a pose: COLMAP's `abs_pose_min_num_inliers`
BETTER_PHOTOGRAPHS = (
    "Take photographs from different places, each sharing most of what it shows with its "
    "neighbors, of things that have texture and keep still, in focus; 20 or more are better"
)
"""The remedy for photographs that show too little."""
OTHER_POSES = (
    "Check the axes of the poses and the photographs' names, or have the poses solved with"
    """ --CameraPoses-settings '{"poses": "solved"}'"""
)
"""The remedy for given poses that do not fit."""


@dataclass(frozen=True, slots=True)
class SfmResult:
    """The models of one mapper, the largest first, and how they came to be.

    `explained` is the fraction of the verified matches between placed photographs whose two
    features are one point of the largest model. A model fooled by things that repeat (a wallpaper)
    leaves many unexplained, however small its reprojection error. Points are in three photographs
    or more; with given poses of at most 20 photographs, those in two count if else too little is
    explained. Where it `has_own_lenses`, each photograph whose lens was assumed to be that of
    others had its own.
    """

    models: Sequence[pycolmap.Reconstruction]
    matcher: str
    verified_pairs: int
    mapper: str
    mapper_reason: str
    explained: float
    has_own_lenses: bool = False

    @property
    def registered(self) -> int:
        """The number of images in the largest model."""
        return int(self.models[0].num_reg_images()) if self.models else 0

    @property
    def registered_photographs(self) -> int:
        """The same, views of one panorama counted as one: they are one frame of COLMAP's."""
        return int(self.models[0].num_reg_frames()) if self.models else 0

    @property
    def quality(self) -> tuple[float, float]:
        """The larger of two is the better mapping.

        Of two that explain enough, it is the one that places more photographs; a mapping that
        explains less counts for so many photographs fewer. At equality it is the one that explains
        more.
        """
        return self.registered * min(self.explained, ENOUGH_EXPLAINED), self.explained


def is_explained(mapping: SfmResult) -> bool:
    """Returns whether the model explains 80 % of the matches between its photographs."""
    return mapping.explained >= ENOUGH_EXPLAINED


def require_enough(mapping: SfmResult, photographs: Sequence[Photograph]) -> None:
    """Refuses a mapping of fewer than three photographs; views of one panorama are one.

    Raises:
        InputError: Fewer were placed.
    """
    count = mapping.registered_photographs
    if count < FEWEST_PHOTOGRAPHS:
        placed = f"only {count}" if count else "none"
        problem = (
            f"{placed} of them could be placed "
            f"({mapping.verified_pairs} pairs show the same things)"
        )
        raise InputError(_counted(photographs), problem, BETTER_PHOTOGRAPHS)


def require_explained(
    mapping: SfmResult, photographs: Sequence[Photograph], least_explained: float
) -> None:
    """Refuses poses that contradict most of what the photographs share.

    Raises:
        InputError: The fraction of the matches that they explain is below `least_explained`.
    """
    if mapping.explained < least_explained:
        problem = (
            f"agree with no poses that were found: the best ones, of"
            f" {mapping.registered_photographs} photographs, explain {mapping.explained:.0%} of"
            f" what these share, and have to explain {least_explained:.0%}:"
            f" {mapping.mapper_reason}"
        )
        remedy = (
            f"{BETTER_PHOTOGRAPHS}. To use these poses in spite of it:"
            """ --CameraPoses-settings '{"least_explained": 0}'"""
        )
        raise InputError(_counted(photographs), problem, remedy)


def _counted(photographs: Sequence[Photograph]) -> str:
    return f"the {len({one.panorama or one.name for one in photographs})} photographs"


def explained_fraction(database: Path, models: Sequence[pycolmap.Reconstruction]) -> float:
    """Returns the fraction of the matches that the first model explains, see `SfmResult`."""
    if not models:
        return 0.0
    model = models[0]
    points = {
        image_id: np.array(
            [
                point.point3D_id if point.has_point3D() else -1
                for point in model.image(image_id).points2D
            ],
            dtype=np.int64,
        )
        for image_id in model.reg_image_ids()
    }
    explained = total = 0
    with closing(pycolmap.Database.open(database)) as opened:
        for pair, geometry in zip(*opened.read_two_view_geometries(), strict=True):
            a, b = pycolmap.pair_id_to_image_pair(pair)
            if a in points and b in points and len(geometry.inlier_matches):
                first, second = np.asarray(geometry.inlier_matches).T
                same = points[a][first] == points[b][second]
                explained += int((same & (points[a][first] >= 0)).sum())
                total += len(first)
    return explained / max(total, 1)


def could_be_placed(database: Path, model: pycolmap.Reconstruction) -> bool:
    """Returns whether some image that a model lacks shares enough with its images to be placed.

    A mapper needs 30 points for a pose, so an image with fewer verified matches with all images of
    the model cannot be placed in it.
    """
    placed = set(model.reg_image_ids())
    shared: Counter[int] = Counter()
    with closing(pycolmap.Database.open(database)) as opened:
        for pair, geometry in zip(*opened.read_two_view_geometries(), strict=True):
            a, b = pycolmap.pair_id_to_image_pair(pair)
            if (a in placed) != (b in placed):
                shared[b if a in placed else a] += len(geometry.inlier_matches)
    return any(count >= _LEAST_INLIERS for count in shared.values())


def flat_fraction(database: Path) -> float:
    """Returns the fraction of the verified pairs whose matches fit one homography.

    They show one plane, or were taken from one spot: a model of such pairs alone has made-up depth.
    """
    flat = pycolmap.TwoViewGeometryConfiguration.PLANAR_OR_PANORAMIC
    with closing(pycolmap.Database.open(database)) as opened:
        _, geometries = opened.read_two_view_geometries()
    kinds = [geometry.config for geometry in geometries if len(geometry.inlier_matches)]
    return sum(kind == flat for kind in kinds) / max(len(kinds), 1)
