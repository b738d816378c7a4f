"""The disk space of the frames of a command, predicted before its first stage begins.

Only frames grow: a video of 4K for a minute takes more than all else together. Their bytes per
pixel are measured (horns, 504x378: `benchmarks/history.md`, "Disk, predicted and measured").
"""

from collections.abc import Mapping, Sequence

from styletrf.errors import InputError
from tasks.planning.memory_demand import Demand, Photographs, frame_pixels

_FLOATS, _PICTURE = 8.7, 2.5
BYTES_A_PIXEL = {
    "TrajectoryFrames": _FLOATS,
    "StylizedFrames": _PICTURE,
    "StylizedFrames own depths": _PICTURE + _FLOATS,
    "StylizedFrames per-frame": _PICTURE,
}
"""The bytes of one pixel of a frame on disk, by stage.

A frame has colors and depths as floats, or a picture and its part of the video, or both.
"""


def written_bytes(demand: Demand, photographs: Photographs) -> float:
    """Returns the bytes of the frames that a stage writes; 0 for stages that write none."""
    pixels = demand.frames * frame_pixels(demand, photographs)
    return BYTES_A_PIXEL.get(demand.stage, 0.0) * pixels


def require_disk(
    demands: Sequence[Demand], free_bytes: int, scenes: Mapping[str, Photographs]
) -> None:
    """Rejects a command whose frames take more than the free disk space.

    Args:
        demands: The demands of the stages that are to be made.
        free_bytes: The free bytes of the disk of the store.
        scenes: The photographs of each scene; other scenes are not checked.

    Raises:
        InputError: The frames of all stages together take more.
    """
    known = [demand for demand in demands if demand.scene in scenes]
    sizes = [written_bytes(demand, scenes[demand.scene]) for demand in known]
    needed = sum(sizes)
    if needed <= free_bytes:
        return
    worst = known[sizes.index(max(sizes))]
    pixels = frame_pixels(worst, scenes[worst.scene])
    raise InputError(
        f"{worst.frames} frames of {pixels / 1e6:.1f} megapixels in scene {worst.scene}",
        f"take about {needed / 1e9:.1f} GB on disk with the other frames of the command,"
        f" and {free_bytes / 1e9:.1f} GB are free",
        "Give a smaller --frame-size or fewer frames, free some space (python -m pipeline gc), or"
        " set STYLETRF_STORE to another disk; --keep-going begins anyway",
    )
