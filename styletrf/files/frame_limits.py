"""The sizes and rates that a video of frames may have."""

SMALLEST_PX, LARGEST_PX = 16, 3840  # of the longer side
SLOWEST_RATE, FASTEST_RATE = 24, 60  # frames a second
DEFAULT_RATE = 24
