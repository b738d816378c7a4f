"""The peak memory of the stages of a command, predicted before any of them begins.

The memory of a stage is a constant for libraries plus terms in proportion to the pixels of a frame,
of a prior or of all photographs, and to the points of the field's grid. The coefficients are
measured: `benchmarks/history.md` compares predictions and measurements.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from styletrf.errors import InputError

MARGIN = 1.5
"""A command is refused if a stage would take more than this multiple of the available memory."""
LONGEST_PX = 1600  # of the undistorted photographs


@dataclass(frozen=True, slots=True)
class Growth:
    """The memory of a stage: MiB for its libraries, and bytes per unit of its inputs.

    Units are pixels of a frame, of a prior and of all photographs, points of the grid, and bytes of
    the rays that an adaptation keeps.
    """

    libraries_mib: int = 450
    frame: float = 0.0
    prior: float = 0.0
    photographs: float = 0.0
    grid: float = 0.0
    rays: float = 0.0


GROWTH = {
    "RadianceField": Growth(700, photographs=6, grid=15),
    "TrajectoryFrames": Growth(650, frame=120),
    "StylizedPriors": Growth(450, prior=1300),
    "StylizedField": Growth(650, prior=6000),
    "StylizedField pixels": Growth(650, prior=1650, rays=2),
    "StylizedField s1": Growth(700, photographs=6, grid=15),
    "StylizedField s2": Growth(700, photographs=6, grid=15),
    "StylizedFrames": Growth(500, frame=95),
    "StylizedFrames own depths": Growth(500, frame=95),  # as without depths
    "StylizedFrames per-frame": Growth(430, frame=320),
    "ConsistencyMetrics": Growth(450, frame=490),
    "StyleMetrics": Growth(580, frame=62),
}
"""By stage; with the method, the loss or the strategy if that decides what the stage computes."""


@dataclass(frozen=True, slots=True)
class Demand:
    """The inputs that decide the memory of a stage, in types that JSON has.

    `photograph_px` is the longer side of the photographs that the field is fitted to, `frame_px`
    that of the frames and `prior_px` that of the priors, 0 for the same, and `frames` the number of
    frames. `rays` is the number that an adaptation keeps beside one for each point of a surface, at
    most one for each pixel of the `priors`, which are 0 if their number is not known.
    `limit_bytes` is the user's limit of memory, 0 for none.
    """

    stage: str
    scene: str
    photograph_px: int
    frame_px: int
    grid_points: int
    video_frames: int
    limit_bytes: int
    frames: int = 0
    prior_px: int = 0
    priors: int = 0
    rays: int = 0
    ray_bytes: float = 0.0


@dataclass(frozen=True, slots=True)
class Photographs:
    """The number of photographs of a scene, and the size of the first in pixels.

    `filmed_pixels` are those of all frames of its videos, from which the photographs are chosen.
    """

    count: int
    width: int
    height: int
    filmed_pixels: int = 0

    def pixels(self, long_side_px: int) -> int:
        """Returns the pixels of a photograph with this longer side."""
        return round(long_side_px**2 * min(self.width, self.height) / max(self.width, self.height))


def predicted_bytes(demand: Demand, photographs: Photographs) -> dict[str, float]:
    """Returns the peak memory of a stage by cause; the sum is that of the stage."""
    growth = GROWTH[demand.stage]
    seen, prior = (photographs.pixels(side(demand, photographs)) for side in (_seen_px, _prior_px))
    rays = min(demand.rays, demand.priors * prior) if demand.priors else demand.rays
    return {
        "libraries": growth.libraries_mib << 20,
        "frames": growth.frame * frame_pixels(demand, photographs),
        "priors": growth.prior * prior + growth.rays * demand.ray_bytes * rays,
        "photographs": growth.photographs * photographs.count * seen,
        "grid": growth.grid * demand.grid_points,
    }


def frame_pixels(demand: Demand, photographs: Photographs) -> int:
    """Returns the pixels of a frame of the fly-through."""
    return photographs.pixels(demand.frame_px or _seen_px(demand, photographs))


def require_memory(
    demands: Sequence[Demand], available_bytes: int, scenes: dict[str, Photographs]
) -> None:
    """Rejects a command that takes clearly more memory than is available.

    Args:
        demands: Of the stages.
        available_bytes: Memory that a process can get now.
        scenes: The photographs of each scene; other scenes are not checked.

    Raises:
        InputError: A stage would take more than `MARGIN` times what is available to it.
    """

    def overdraft(demand: Demand) -> float:
        """Returns the ratio of a stage's memory to its limit."""
        taken = sum(predicted_bytes(demand, scenes[demand.scene]).values())
        return taken / _allowed(demand, available_bytes)

    known = [demand for demand in demands if demand.scene in scenes]
    worst = max(known, key=overdraft, default=None)
    if worst is None or overdraft(worst) <= MARGIN:
        return
    parts = predicted_bytes(worst, scenes[worst.scene])
    cause, remedy = _cause(worst, scenes[worst.scene], parts)
    needed, allowed = sum(parts.values()) / 2**30, _allowed(worst, available_bytes) / 2**30
    raise InputError(
        f"{worst.stage} of scene {worst.scene}, {cause}",
        f"takes about {needed:.1f} GiB of memory, and {allowed:.1f} GiB are available",
        f"{remedy}, or free memory; --keep-going begins anyway",
    )


def _seen_px(demand: Demand, photographs: Photographs) -> int:
    return min(demand.photograph_px, LONGEST_PX, max(photographs.width, photographs.height))


def _prior_px(demand: Demand, photographs: Photographs) -> int:
    """Returns the longer side of the priors, which may be above that of the field's photographs."""
    wanted = demand.prior_px or demand.photograph_px
    return _seen_px(replace(demand, photograph_px=wanted), photographs)


def _allowed(demand: Demand, available_bytes: int) -> int:
    return max(1, min(available_bytes, demand.limit_bytes or available_bytes))


def _cause(demand: Demand, photographs: Photographs, parts: dict[str, float]) -> tuple[str, str]:
    """Returns the largest cause of a stage's memory beside the libraries, and the remedy."""
    seen = _seen_px(demand, photographs)
    size = f"{demand.frame_px or seen} pixels long"
    causes = {
        "frames": (f"with frames {size}", "Give a smaller --frame-size"),
        "photographs": (
            f"with {photographs.count} photographs {seen} pixels long",
            "Give --quality draft or fewer photographs",
        ),
        "priors": (
            f"with priors {_prior_px(demand, photographs)} pixels long",
            "Give a smaller long_side_px in --PriorRenders-settings",
        ),
        "grid": (
            f"with a grid of up to {demand.grid_points:,} points",
            "Give --quality draft, or a smaller max_voxels in --SceneModel-settings",
        ),
    }
    return causes[max(causes, key=lambda name: parts[name])]
