"""The report on camera poses: `poses.json`, its warnings, and reasons to doubt the poses."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from styletrf.capture.capture_file import Photograph
from styletrf.capture.poses.colmap_model import lens_of
from styletrf.capture.poses.given_poses import Lens
from styletrf.sfm.colmap_images import ColmapImages
from styletrf.sfm.mapping import BETTER_PHOTOGRAPHS, OTHER_POSES, SfmResult, is_explained
from styletrf.sfm.reconstruction import PlacedPhotograph

_LARGE_ERROR = 0.003  # of a reprojection, by an image's longer side
FLAT = 0.95
"""Below this fraction of flat pairs, photographs have parallax.

Above it, `parallax_fraction` of the points decides.
"""


@dataclass(frozen=True, slots=True)
class FoundLens:
    """A lens before undistortion, and how many photographs it took."""

    lens: Lens
    photographs: int


@dataclass(frozen=True, slots=True)
class PosesReport:
    """The content of `poses.json`; the lens is the first before undistortion, in pixels of `width`.

    `focal_prior_px` is the known focal length that the search for this lens began with, None where
    there was none. `lens_settings` counts those of all photographs. `lenses` are those of all
    placed photographs, the one that took most of them first. `photograph_sizes` are width and
    height of the placed photographs as they came, by name.

    `flat_pairs` is the fraction of the pairs most of whose matches fit one homography. If nearly
    all do, and nearly all points, too, the photographs have no parallax. `doubts` are warnings that
    the poses may be wrong.
    """

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
    flat_pairs: float
    has_parallax: bool
    pieces: tuple[int, ...]
    camera_model: str
    camera_params: tuple[float, ...]
    focal_px: float
    focal_prior_px: float | None
    lens_settings: int
    width: int
    height: int
    lenses: tuple[FoundLens, ...]
    photograph_sizes: dict[str, tuple[int, int]]
    doubts: tuple[str, ...]

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings: photographs without a camera, and the doubts."""
        if not self.unregistered:
            return self.doubts
        unplaced = (
            f"only {self.registered} of {self.total} photographs could be placed, the others"
            " show another place or share too little with them; "
            f"without a camera: {', '.join(self.unregistered)}"
        )
        return unplaced, *self.doubts


def poses_report(
    images: ColmapImages,
    photographs: Sequence[Photograph],
    mapping: SfmResult,
    placed: Sequence[PlacedPhotograph],
    flat: float,
    *,
    has_parallax: bool,
    is_given: bool,
) -> PosesReport:
    """Returns the content of `poses.json` for a mapping whose photographs are placed.

    Args:
        images: The photographs as COLMAP saw them.
        photographs: All photographs.
        mapping: The mapping that was found.
        placed: Those that have a camera.
        flat: The fraction of flat pairs; 0 of poses that were given.
        has_parallax: Whether there is parallax between the photographs.
        is_given: Whether the poses came with the photographs.
    """
    model, lens = mapping.models[0], placed[0].lens
    registered = {one.camera.name for one in placed}
    unregistered = tuple(one.name for one in photographs if one.name not in registered)
    sizes = {one.name: (one.width, one.height) for one in photographs if one.name in registered}
    pieces = tuple(int(piece.num_reg_images()) for piece in mapping.models)
    error_fraction = model.compute_mean_reprojection_error() / images.long_side
    return PosesReport(
        registered=len(placed),
        total=len(photographs),
        unregistered=unregistered,
        mean_reprojection_error_px=float(model.compute_mean_reprojection_error()),
        points=int(model.num_points3D()),
        matcher=mapping.matcher,
        verified_pairs=mapping.verified_pairs,
        mapper=mapping.mapper,
        mapper_reason=mapping.mapper_reason,
        matches_explained=mapping.explained,
        flat_pairs=flat,
        has_parallax=has_parallax,
        pieces=pieces,
        camera_model=str(lens.model_name),
        camera_params=tuple(float(value) for value in lens.params),
        focal_px=float(lens.mean_focal_length()),
        focal_prior_px=_focal_prior_px(images, placed[0].file),
        lens_settings=len(images.lenses),
        width=int(lens.width),
        height=int(lens.height),
        lenses=_lenses(placed),
        photograph_sizes=sizes,
        doubts=(
            *_doubts_of_model(pieces, error_fraction),
            *_doubts_of_matches(mapping, has_parallax=has_parallax, is_given=is_given),
        ),
    )


def _focal_prior_px(images: ColmapImages, file: str) -> float | None:
    """Returns the focal length that the lens setting of a file began with; None where with none."""
    return next(one.focal_prior_px for one in images.lenses if file in one.files)


def _lenses(placed: Sequence[PlacedPhotograph]) -> tuple[FoundLens, ...]:
    counts = Counter(lens_of(one.lens) for one in placed)
    return tuple(FoundLens(lens, count) for lens, count in counts.most_common())


def _doubts_of_model(pieces: Sequence[int], error_fraction: float) -> list[str]:
    """Returns the doubts about the poses that the points and the pieces raise."""
    doubts = []
    if error_fraction > _LARGE_ERROR:
        doubts.append(
            f"the points are {error_fraction:.1%} of an image's longer side off on average, too"
            " much for sharp renders: the poses, the lens or the order of the photographs may be"
            " wrong"
        )
    if len(pieces) > 1:
        sizes = ", ".join(str(size) for size in pieces)
        doubts.append(
            f"the photographs fall into pieces without overlap (of {sizes}): the largest is used"
        )
    return doubts


def _doubts_of_matches(mapping: SfmResult, *, has_parallax: bool, is_given: bool) -> list[str]:
    """Returns warnings where the poses contradict matches, or the matches have no parallax."""
    doubts = []
    if not is_explained(mapping):
        agrees = f"only {mapping.explained:.0%} of what the photographs share agrees with"
        doubts.append(
            f"{agrees} the poses that came with them: some may be wrong. {OTHER_POSES}"
            if is_given
            else f"{agrees} their poses: some may be in wrong places, as where things repeat. "
            + BETTER_PHOTOGRAPHS
        )
    if not has_parallax:
        doubts.append(
            "the photographs were taken from one spot, or show nothing but a flat wall: they tell"
            " no depth. " + BETTER_PHOTOGRAPHS
        )
    return doubts
