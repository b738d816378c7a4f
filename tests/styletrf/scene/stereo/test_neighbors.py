"""Neighbors share points, at angles that tell depths."""

import numpy as np
from captures import arc, points_of, seen

from styletrf.geometry.cameras import Camera
from styletrf.scene.stereo.neighbors import MOST, neighbors


def angle_deg(a: Camera, b: Camera) -> float:
    """Returns the angle between the cameras, seen from the origin that they look at."""
    cosine = a.center_world @ b.center_world
    lengths = np.linalg.norm(a.center_world) * np.linalg.norm(b.center_world)
    return float(np.degrees(np.arccos(np.clip(cosine / lengths, -1, 1))))


def test_neighbors_on_an_arc_are_other_cameras_at_a_useful_angle():
    cameras = arc(20.0, n=60)
    found = neighbors(cameras, seen(cameras, points_of("object")))
    for k, chosen in enumerate(found):
        assert len(chosen) == MOST
        assert len({k, *chosen}) == MOST + 1
        assert all(4 < angle_deg(cameras[k], cameras[j]) < 40 for j in chosen)


def test_photographs_from_one_place_are_not_compared_where_others_are_at_hand():
    cameras = arc(20.0, n=40)
    cameras = [*cameras, cameras[0]]
    assert 40 not in neighbors(cameras, seen(cameras, points_of("object")))[0]


def test_photographs_that_share_no_points_have_no_neighbors():
    cameras = arc(20.0, n=4)
    points = seen(cameras, points_of("object")).of_images([])
    assert neighbors(cameras, points) == [[], [], [], []]
