from pathlib import Path

import numpy as np

from styletrf.capture.poses.given_poses import GivenView, Lens
from styletrf.sfm.known_poses import neighboring_pairs


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
