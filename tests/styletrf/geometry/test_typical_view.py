"""Renders have the lens and the shape of most photographs."""

from dataclasses import replace

import numpy as np
import pytest
from captures import arc

from styletrf.geometry.cameras import resized
from styletrf.geometry.typical_view import typical_view


def shaped(sizes, focals=None):
    cameras = arc(20, n=len(sizes))
    focals = focals or [50.0] * len(sizes)
    return [
        replace(camera, width=w, height=h, cx=w / 2, cy=h / 2, fx=f, fy=f)
        for camera, (w, h), f in zip(cameras, sizes, focals, strict=True)
    ]


def test_photographs_of_one_lens_give_that_lens_exactly():
    cameras = shaped([(60, 45)] * 5)
    view = typical_view(cameras)
    assert (view.width, view.height, view.fx, view.cx) == (60, 45, 50.0, 30.0)


@pytest.mark.parametrize(
    ("sizes", "shape"),
    [
        ([(60, 45)] * 3 + [(45, 60)] * 2, (60, 45)),
        ([(60, 45)] * 2 + [(45, 60)] * 3, (45, 60)),
        ([(60, 45)] * 2 + [(45, 60)] * 2, (60, 45)),
        ([(60, 45), (40, 30), (80, 60), (90, 30)], (90, 68)),
    ],
)
def test_most_photographs_decide_the_shape_and_the_longest_the_size(sizes, shape):
    view = typical_view(shaped(sizes))
    assert (view.width, view.height) == shape


def test_one_long_lens_among_many_changes_nothing():
    cameras = shaped([(60, 45)] * 5, [50.0, 500.0, 50.0, 50.0, 50.0])
    assert typical_view(cameras).fx == 50.0


def test_a_photograph_reduced_counts_as_at_its_full_size():
    cameras = shaped([(60, 45)] * 3)
    reduced = [resized(camera, 20, 15) for camera in cameras[:2]] + cameras[2:]
    np.testing.assert_allclose(typical_view(reduced).fx, typical_view(cameras).fx)
