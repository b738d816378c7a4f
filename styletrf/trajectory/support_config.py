"""Settings of the support of a path by photographs: see `styletrf.trajectory.support`."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SupportConfig:
    """Settings of the measurement of support, and how much of it the default path needs.

    The path is narrowed where that brings the fraction of its pixels that are unsupported below
    `most_unsupported`. It gives way to stills where that stays at `least_for_stills` or more.
    `depth_px` is the longer side of the depth maps, `tolerance` a fraction of a depth,
    `parallax_px` a shift in these maps; surfaces that differ by no more than either are the same
    one. `frames` is how many frames of a path are looked at, spread evenly.
    """

    most_unsupported: float = 0.02
    least_for_stills: float = 0.2
    depth_px: int = 96
    tolerance: float = 0.1
    parallax_px: float = 1.0
    frames: int = 24

    def __post_init__(self) -> None:
        if self.depth_px < 1 or self.frames < 1 or min(self.tolerance, self.parallax_px) < 0:
            raise ValueError(f"support cannot be measured so: {self}")
