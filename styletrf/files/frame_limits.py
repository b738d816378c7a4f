"""The sizes and rates that a video of frames may have."""

SMALLEST_PX, LARGEST_PX = 64, 3840  # of the longer side; painting takes 16 of the shorter
SLOWEST_RATE, FASTEST_RATE = 24, 60  # frames a second
DEFAULT_RATE = 24
