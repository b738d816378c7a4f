"""The images of a set of views, each of its own size, as one list of pixels.

Pixels have numbers: row by row, view after view. Rays are chosen by these numbers, so that every
pixel of every photograph is drawn alike, whatever the sizes of the photographs.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64, UInt8
from torch import Tensor

_GOLDEN = (math.sqrt(5) - 1) / 2

Image = UInt8[Tensor, "_ _ _"]
"""Height, width and channels: RGB, or RGBA where the pixels of alpha 0 do not count.

Each image of a list has its own size, so that the axes have no names to be checked by.
"""


@dataclass(frozen=True, slots=True)
class ViewImages:
    """The pixels of all views; `ends` are their numbers after the last pixel of each view.

    `counted` are the numbers of the pixels that count, where not all do.
    """

    pixels: UInt8[Tensor, "pixels 3"]
    ends: Int64[Tensor, " views"]
    widths: Int64[Tensor, " views"]
    counted: Int64[Tensor, " counted"] | None = None

    @property
    def device(self) -> torch.device:
        """The device of the pixels."""
        return self.pixels.device

    def __len__(self) -> int:
        """The number of pixels."""
        return len(self.pixels)

    def drawn(self, count: int, generator: torch.Generator) -> Int64[Tensor, " rays"]:
        """Returns `count` pixels that count, drawn with replacement, on the images' device.

        Args:
            count: Of the pixels.
            generator: On the CPU.
        """
        among = len(self) if self.counted is None else len(self.counted)
        index = torch.randint(among, (count,), generator=generator).to(self.device)
        return index if self.counted is None else self.counted[index]

    def spread(self, first: int, count: int) -> Int64[Tensor, " rays"]:
        """Returns `count` pixels that count, spread evenly over all views, on the images' device.

        They are the members `first` to `first + count - 1` of a Weyl sequence: the k-th is pixel
        k s mod n of the n that count, s being next to n / golden ratio and coprime to n. So any n
        members in a row have each pixel once, and fewer lie in all views and rows alike.

        Args:
            first: Member, at least 0.
            count: Of the pixels.
        """
        n = len(self) if self.counted is None else len(self.counted)
        stride = round(n * _GOLDEN)
        while math.gcd(stride, n) > 1:
            stride += 1
        members = torch.arange(count, device=self.device) * stride
        index = (members + first * stride % n) % n  # no product of two numbers near n: it overflows
        return index if self.counted is None else self.counted[index]

    def of_view(self, view: int) -> Int64[Tensor, " pixels"]:
        """Returns the numbers of one view's pixels."""
        first = int(self.ends[view - 1]) if view else 0
        return torch.arange(first, int(self.ends[view]), device=self.device)

    def places(
        self, pixels: Int64[Tensor, " rays"]
    ) -> tuple[Int64[Tensor, " rays"], Float[Tensor, "rays 2"]]:
        """Returns the view of each pixel, and its center (x, y) in pixels of that view.

        The centers are float64, as `ViewRays.segments` takes them.
        """
        view = torch.searchsorted(self.ends, pixels, right=True)
        starts = torch.cat([self.ends.new_zeros(1), self.ends[:-1]])
        within, width = pixels - starts[view], self.widths[view]
        corner = torch.stack([within % width, within // width], dim=-1)
        return view, corner.double() + 0.5


def view_images(images: Iterable[Image]) -> ViewImages:
    """Returns the images as one list of pixels, on their device.

    Raises:
        ValueError: There are no images, or none of their pixels counts.
    """
    of_views = list(images)
    if not of_views:
        raise ValueError("there are no images")
    device = of_views[0].device
    sizes = torch.tensor([image.shape[0] * image.shape[1] for image in of_views], device=device)
    widths = torch.tensor([image.shape[1] for image in of_views], device=device)
    pixels = torch.cat([image[..., :3].reshape(-1, 3) for image in of_views])
    return ViewImages(pixels, sizes.cumsum(0), widths, _counted(of_views))


def _counted(of_views: Sequence[Image]) -> Int64[Tensor, " counted"] | None:
    if all(image.shape[2] == 3 for image in of_views):
        return None
    counts = [
        image[..., 3].reshape(-1) > 0
        if image.shape[2] == 4
        else image.new_ones(image.shape[0] * image.shape[1], dtype=torch.bool)
        for image in of_views
    ]
    counted = torch.cat(counts).nonzero()[:, 0]
    if len(counted) == 0:
        raise ValueError("no pixel of the images counts")
    return counted
