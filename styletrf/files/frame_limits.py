"""The sizes and rates that a video of frames may have."""

SMALLEST_PX, LARGEST_PX = 64, 3840  # of the longer side; painting takes 16 of the shorter
SLOWEST_RATE, FASTEST_RATE = 24, 60  # frames a second
DEFAULT_RATE = 24


def require_frame_limits(long_side_px: int, frames_per_second: int) -> None:
    """Refuses a size, unless it is 0, or a rate that a video of frames may not have.

    Raises:
        ValueError: One is out of its range.
    """
    if long_side_px and not SMALLEST_PX <= long_side_px <= LARGEST_PX:
        bounds = f"{SMALLEST_PX} to {LARGEST_PX}"
        raise ValueError(f"long_side_px is {long_side_px}, not 0 or from {bounds} pixels")
    if not SLOWEST_RATE <= frames_per_second <= FASTEST_RATE:
        bounds = f"{SLOWEST_RATE} to {FASTEST_RATE}"
        raise ValueError(f"frames_per_second is {frames_per_second}, not from {bounds}")
