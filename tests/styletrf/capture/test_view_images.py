"""The order of pixels in a fit: each once before any again, spread over all views."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from styletrf.capture.view_images import ViewImages, view_images

SIZES = st.lists(st.tuples(st.integers(1, 9), st.integers(1, 9)), min_size=1, max_size=6)


def images_of(sizes, channels=3) -> ViewImages:
    return view_images(torch.zeros((*size, channels), dtype=torch.uint8) for size in sizes)


@given(sizes=SIZES, first=st.integers(0, 1 << 40))
def test_as_many_pixels_as_there_are_have_each_once(sizes, first):
    images = images_of(sizes)
    found = images.spread(first, len(images))
    assert sorted(found.tolist()) == list(range(len(images)))


@given(sizes=SIZES, first=st.integers(0, 1 << 40), counts=st.tuples(*2 * [st.integers(0, 50)]))
def test_a_part_goes_on_where_the_part_before_it_ends(sizes, first, counts):
    images = images_of(sizes)
    parts = [images.spread(first, counts[0]), images.spread(first + counts[0], counts[1])]
    assert torch.cat(parts).equal(images.spread(first, sum(counts)))


def test_masked_pixels_are_left_out():
    image = torch.zeros((8, 8, 4), dtype=torch.uint8)
    image[2:5, 1:7, 3] = 255
    images = view_images([image])
    assert images.counted is not None
    assert sorted(images.spread(5, 18).tolist()) == images.counted.tolist()


@pytest.mark.parametrize("first", [0, 12345])
def test_each_batch_is_spread_evenly_over_views(first):
    images = images_of(40 * [(60, 80)])
    view, _ = images.places(images.spread(first, 1600))
    counts = torch.bincount(view, minlength=40)
    assert (counts - 40).abs().max() <= 3, "at random, they would differ by about 15"


def test_numbers_of_many_large_photographs_do_not_overflow():
    n = 4_000_000_000

    class Many(ViewImages):
        def __len__(self) -> int:
            return n

    few = images_of([(1, 1)])
    found = Many(few.pixels, few.ends, few.widths).spread(n - 1, 1000)
    stride = int(found[2] - found[1]) % n
    assert math.gcd(stride, n) == 1
    assert found.tolist() == [(n - 1 + k) * stride % n for k in range(1000)]
