import pytest
from mapped_walks import frames, mapped, street, walked

from styletrf.sfm.model_support import supported, supported_images

COUNT = 12


@pytest.fixture
def model(tmp_path):
    return mapped(*walked(tmp_path, street(COUNT)), frames(COUNT), 90).models[0]


def halves(model):
    ids = sorted(model.reg_image_ids())
    return set(ids[: COUNT // 2 + 1]), set(ids[COUNT // 2 + 1 :])


def test_photographs_of_one_walk_all_hang_together(model):
    assert supported_images(model) == set(model.reg_image_ids())


def test_halves_held_together_by_points_of_two_photographs_are_two(model):
    """All points that tell how far one half is from the other are taken away."""
    first, second = halves(model)
    for point_id, point in list(model.points3D.items()):
        seen = {element.image_id for element in point.track.elements}
        if seen & first and seen & second and len(seen) > 2:
            model.delete_point3D(point_id)
    assert supported_images(model) == first
    kept = supported(model)
    assert set(kept.reg_image_ids()) == first
    assert model.num_reg_images() == COUNT


def test_points_of_two_photographs_alone_support_nothing(model):
    for point_id, point in list(model.points3D.items()):
        if point.track.length() > 2:
            model.delete_point3D(point_id)
    assert supported_images(model) == set()
