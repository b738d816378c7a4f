"""Settles which pairs of frames are compared; this file imports none of the numerics."""

from dataclasses import dataclass

SHORT_TERM, LONG_TERM, LONG_TERM_OF_THE_FIELD = 1, 5, 7


@dataclass(frozen=True, slots=True)
class PairPlan:
    """Which frames are compared.

    Attributes:
        deltas: Frames between the two of a pair.
        depth_deltas: The same for pairs that are compared along the depth alone; 7 is what the
            papers since StyleTRF call long term.
        pairs: The most pairs of a delta, spread evenly over the trajectory.
        perceptual_pairs: The most of these that go through the perceptual network.
    """

    deltas: tuple[int, ...] = (SHORT_TERM, LONG_TERM)
    depth_deltas: tuple[int, ...] = (LONG_TERM_OF_THE_FIELD,)
    pairs: int = 12
    perceptual_pairs: int = 4

    def __post_init__(self) -> None:
        if not self.deltas or min(self.deltas) < 1:
            raise ValueError(f"deltas are {self.deltas}, not distances from 1")
        if min(self.depth_deltas, default=1) < 1:
            raise ValueError(f"depth_deltas are {self.depth_deltas}, not distances from 1")
        if min(self.pairs, self.perceptual_pairs) < 1:
            raise ValueError("pairs and perceptual_pairs are at least 1")
