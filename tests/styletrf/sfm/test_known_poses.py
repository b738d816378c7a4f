from contextlib import closing
from pathlib import Path

import numpy as np
import pycolmap
import pytest

from styletrf.capture.poses.given_poses import GivenView, Lens
from styletrf.sfm import known_poses
from styletrf.sfm.known_poses import NEIGHBORS, neighboring_pairs
from styletrf.sfm.mapping import explained_fraction
from styletrf.sfm.pose_adjustment import triangulated


def test_many_views_are_matched_with_their_neighbors_that_look_the_same_way():
    """A ring of outward views: nobody is matched across it."""
    angles = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    lens, views = Lens("PINHOLE", (1.0, 1.0, 0.5, 0.5), 1, 1), []
    for angle in angles:
        ahead = np.array([np.cos(angle), 0, np.sin(angle)])
        right = np.array([-np.sin(angle), 0, np.cos(angle)])
        pose = np.column_stack([right, np.cross(ahead, right), ahead, 3 * ahead])
        views.append(GivenView(Path(), lens, pose))
    pairs = neighboring_pairs(views)
    steps = [min(j - i, 100 - (j - i)) for i, j in pairs]
    assert max(steps) == 10
    assert len(pairs) == 1000


def matched_by_twos(database, photographs):
    """Photographs of which each pair of neighbors shares points that no other one shows."""
    options = pycolmap.SyntheticDatasetOptions(
        num_rigs=1, num_frames_per_rig=photographs, num_points3D=20 * photographs
    )
    pycolmap.set_random_seed(1)
    with closing(pycolmap.Database.open(database)) as opened:
        truth = pycolmap.synthesize_dataset(options, opened)
        pairs, geometries = opened.read_two_view_geometries()
        opened.clear_two_view_geometries()
        for pair, geometry in zip(pairs, geometries, strict=True):
            a, b = sorted(pycolmap.pair_id_to_image_pair(pair))
            if b == a + 1:
                matches, seen = geometry.inlier_matches, truth.images[a].points2D
                own = [seen[index].point3D_id % photographs == a for index in matches[:, 0]]
                geometry.inlier_matches = matches[own]
                opened.write_two_view_geometry(a, b, geometry)
    return truth


@pytest.mark.parametrize(("photographs", "least", "most"), [(6, 0.95, 1), (NEIGHBORS + 1, 0, 0)])
def test_points_in_two_photographs_count_where_these_are_few(tmp_path, photographs, least, most):
    """Wrong poses of many photographs were believed, as any two rays that meet make a point."""
    database = tmp_path / "colmap.db"
    truth = matched_by_twos(database, photographs)
    model = triangulated(truth, database, tmp_path, 0)
    assert explained_fraction(database, [model]) == 0
    assert least <= known_poses.explained_by_given(model, database, tmp_path, 0) <= most
