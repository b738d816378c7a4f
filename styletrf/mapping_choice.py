"""Which pairs to match and which mapper to believe, decided from the photographs themselves."""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from styletrf.colmap import pycolmap
from styletrf.colmap_images import ColmapImages
from styletrf.colmap_mapping import map_globally, map_incrementally, match_pairs
from styletrf.image_pairs import (
    Pairs,
    all_pairs,
    is_sequence,
    pairs_along,
    pairs_with,
    pairs_within,
    shots,
)
from styletrf.progress import Progress
from styletrf.retrieval import Descriptors, similar_pairs
from styletrf.scene_capture import Photograph

ENOUGH_EXPLAINED = 0.8


@dataclass(frozen=True, slots=True)
class Mapping:
    """The models of one mapper, the largest first, and how they came to be.

    `explained` is the share of the verified matches between placed photographs whose two features
    are one point of the largest model. A model fooled by things that repeat (a wallpaper) leaves
    many unexplained, however small its reprojection error.
    """

    models: Sequence[pycolmap.Reconstruction]
    matcher: str
    verified_pairs: int
    mapper: str
    mapper_reason: str
    explained: float

    @property
    def registered(self) -> int:
        """The number of images in the largest model."""
        return int(self.models[0].num_reg_images()) if self.models else 0


def map_images(
    database: Path,
    images: ColmapImages,
    photographs: Sequence[Photograph],
    exhaustive_up_to: int,
    neighbours: int,
    seed: int,
    progress: Progress,
    tracks: int | None = None,
) -> Mapping:
    """Returns the best mapping of the images whose features the database holds.

    All pairs are matched of up to `exhaustive_up_to` photographs. Frames of videos, and more
    photographs whose names read like a sequence, are matched with `neighbours` successors, with
    those 2, 4, 8 ... further on, and with as many that look most like them but are further away;
    others with twice as many that look most like them.
    Photographs that this leaves out are then matched with all others. The global mapper goes first;
    where it does not place all, or explains less than 80 % of the matches, the incremental one is
    tried too, and the mapping with more photographs, at equality the one that explains more, is
    kept. With `tracks`, the global mapper looks at so many of an image only.
    """
    matcher, pairs = _pairs_to_match(database, photographs, exhaustive_up_to, neighbours, seed)
    mapping = _globally(database, images, matcher, pairs, seed, progress, tracks)
    missing = _unplaced(mapping, images)
    more = sorted({*pairs_with(len(photographs), missing)} - {*pairs})
    if more:
        matcher = f"{matcher}, then all pairs of those left out"
        mapping = _globally(database, images, matcher, more, seed, progress, tracks)
    if mapping.verified_pairs == 0 or (
        mapping.registered == len(photographs) and mapping.explained >= ENOUGH_EXPLAINED
    ):
        return mapping
    models = map_incrementally(database, images, seed, progress)
    explained = explained_share(database, models)
    other = replace(mapping, models=models, mapper="incremental", explained=explained)
    reason = "; ".join(
        f"{one.mapper} mapper: {one.registered} placed, {one.explained:.0%} of matches explained"
        for one in (mapping, other)
    )
    return replace(max(mapping, other, key=_quality), mapper_reason=reason)


def _pairs_to_match(
    database: Path,
    photographs: Sequence[Photograph],
    exhaustive_up_to: int,
    neighbours: int,
    seed: int,
) -> tuple[str, Pairs]:
    count, sequences = len(photographs), shots(photographs)
    if not sequences and count <= exhaustive_up_to:
        return "exhaustive", all_pairs(count)
    if not sequences and is_sequence([photograph.name for photograph in photographs]):
        sequences = [list(range(count))]
    along, near = pairs_along(sequences, neighbours), pairs_within(sequences, 2 * neighbours)
    if not sequences:
        return "retrieval", _alike(database, count, 2 * neighbours, near, seed)
    alike = _alike(database, count, neighbours, near, seed)
    return "sequential and retrieval", sorted({*along, *alike})


def _alike(database: Path, count: int, neighbours: int, but: Pairs, seed: int) -> Pairs:
    """Returns pairs that look alike by the features that the database holds."""
    with closing(pycolmap.Database.open(database)) as opened:
        ids = [image.image_id for image in sorted(opened.read_all_images(), key=_name)]

        def descriptors_of(index: int) -> Descriptors:
            return np.asarray(opened.read_descriptors(ids[index]).data)

        return similar_pairs(count, descriptors_of, neighbours, seed, but)


def _name(image: pycolmap.Image) -> str:
    return str(image.name)


def _globally(
    database: Path,
    images: ColmapImages,
    matcher: str,
    pairs: Pairs,
    seed: int,
    progress: Progress,
    tracks: int | None,
) -> Mapping:
    verified = match_pairs(database, images, pairs, seed, progress)
    models = map_globally(database, images, seed, progress, tracks) if verified else []
    reason = "it placed all photographs and explains their matches"
    return Mapping(models, matcher, verified, "global", reason, explained_share(database, models))


def explained_share(database: Path, models: Sequence[pycolmap.Reconstruction]) -> float:
    """Returns the share of the matches that the first model explains, see `Mapping`."""
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


def _unplaced(mapping: Mapping, images: ColmapImages) -> list[int]:
    """Returns the positions of the images that the largest model leaves out."""
    if not mapping.models:
        return list(range(len(images.files)))
    model = mapping.models[0]
    placed = {model.image(image_id).name for image_id in model.reg_image_ids()}
    return [index for index, file in enumerate(images.files) if file not in placed]


def _quality(mapping: Mapping) -> tuple[int, float]:
    return mapping.registered, mapping.explained
