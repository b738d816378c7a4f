"""What is said of camera poses: `poses.json`, its warnings, and what speaks against the poses."""

from collections.abc import Sequence
from dataclasses import dataclass

from styletrf.colmap_images import ColmapImages
from styletrf.mapping import Mapping, is_explained
from styletrf.reconstruction import PlacedPhotograph

_LARGE_ERROR = 0.003  # of a reprojection, by an image's longer side
_FLAT = 0.95  # of the pairs; captures with depth have up to 0.83
BETTER_PHOTOGRAPHS = (
    "Take photographs from different places, each sharing most of what it shows with its "
    "neighbours, of things that have texture and keep still, in focus; 20 or more are better"
)
"""What to do about photographs that tell too little."""


@dataclass(frozen=True, slots=True)
class PosesReport:
    """What `poses.json` says; the lens is the first before undistortion, in pixels of `width`."""

    registered: int
    total: int
    unregistered: tuple[str, ...]
    mean_reprojection_error_px: float
    points: int
    matcher: str
    verified_pairs: int
    mapper: str
    mapper_reason: str
    matches_explained: float
    pieces: tuple[int, ...]
    camera_model: str
    camera_params: tuple[float, ...]
    focal_px: float
    focal_prior_px: float | None
    lens_settings: int
    width: int
    height: int
    warnings: tuple[str, ...]


def poses_report(
    images: ColmapImages,
    names: Sequence[str],
    mapping: Mapping,
    placed: Sequence[PlacedPhotograph],
    doubts: Sequence[str],
) -> PosesReport:
    """Returns what `poses.json` says of a mapping whose photographs are placed."""
    model, lens = mapping.models[0], placed[0].lens
    registered = {one.camera.name for one in placed}
    unregistered = tuple(name for name in names if name not in registered)
    pieces = tuple(int(piece.num_reg_images()) for piece in mapping.models)
    error_share = model.compute_mean_reprojection_error() / images.long_side
    return PosesReport(
        registered=len(placed),
        total=len(names),
        unregistered=unregistered,
        mean_reprojection_error_px=float(model.compute_mean_reprojection_error()),
        points=int(model.num_points3D()),
        matcher=mapping.matcher,
        verified_pairs=mapping.verified_pairs,
        mapper=mapping.mapper,
        mapper_reason=mapping.mapper_reason,
        matches_explained=mapping.explained,
        pieces=pieces,
        camera_model=str(lens.model_name),
        camera_params=tuple(float(value) for value in lens.params),
        focal_px=float(lens.mean_focal_length()),
        focal_prior_px=images.lenses[0].focal_prior_px,
        lens_settings=len(images.lenses),
        width=int(lens.width),
        height=int(lens.height),
        warnings=(
            *_warnings(len(names), unregistered, pieces, error_share),
            *doubts,
        ),
    )


def _warnings(
    total: int, unregistered: Sequence[str], pieces: Sequence[int], error_share: float
) -> list[str]:
    warnings = []
    if error_share > _LARGE_ERROR:
        warnings.append(
            f"the points are {error_share:.1%} of an image's longer side off on average, too much"
            " for sharp renders: the poses, the lens or the order of the photographs may be wrong"
        )
    if unregistered:
        warnings.append(
            f"only {total - len(unregistered)} of {total} photographs could be placed, the others"
            " show another place or share too little with them; "
            f"without a camera: {', '.join(unregistered)}"
        )
    if len(pieces) > 1:
        sizes = ", ".join(str(size) for size in pieces)
        warnings.append(
            f"the photographs fall into pieces without overlap (of {sizes}): the largest is used"
        )
    return warnings


def doubts_about(mapping: Mapping, flat: float) -> list[str]:
    """Returns warnings where the poses contradict matches, or these tell no depth."""
    doubts = []
    if not is_explained(mapping):
        doubts.append(
            f"only {mapping.explained:.0%} of what the photographs share agrees with their poses:"
            " some may be in wrong places, as where things repeat. " + BETTER_PHOTOGRAPHS
        )
    if flat >= _FLAT:
        doubts.append(
            "the photographs were taken from one spot, or show nothing but a flat wall: they tell"
            " no depth. " + BETTER_PHOTOGRAPHS
        )
    return doubts
