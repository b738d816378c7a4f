from contextlib import closing
from shutil import copyfile

import numpy as np
import pycolmap
import pytest
from mapped_walks import OVERLAP, PATH, frames, mapped, named, street, walked
from message_words import mentions

from styletrf.capture.capture_file import Photograph
from styletrf.progress import silent
from styletrf.sfm.mapping import could_be_placed, explained_fraction
from styletrf.sfm.mapping_choice import STRONGER_UP_TO, MappingTask, reconstruct


def filmed(count, clip="a.mp4", shot=0):
    return [
        Photograph(f"{clip}{shot}{k}", "", 200, 150, 1, "", clip, shot, k / 2) for k in range(count)
    ]


def test_few_photographs_are_matched_exhaustively(tmp_path):
    mapping = mapped(*walked(tmp_path, street(8)), frames(8), 8)
    assert (mapping.matcher, mapping.mapper, mapping.registered) == ("exhaustive", "global", 8)


def test_photographs_are_matched_with_those_that_share_most_matches(tmp_path):
    shuffled = np.random.default_rng(1).permutation(30)
    mapping = mapped(*walked(tmp_path, street(30)[shuffled]), frames(30), 10, 30)
    assert (mapping.matcher, mapping.registered) == ("preemptive", 30)
    assert mapping.verified_pairs < 30 * OVERLAP


def test_a_long_sequence_is_matched_along_its_order(tmp_path):
    mapping = mapped(*walked(tmp_path, street(20)), frames(20), 10)
    assert (mapping.matcher, mapping.registered) == ("sequential and retrieval", 20)


def test_few_frames_of_a_video_are_matched_along_time(tmp_path):
    mapping = mapped(*walked(tmp_path, street(20)), filmed(20), 90)
    assert (mapping.matcher, mapping.registered) == ("sequential and retrieval", 20)
    assert mapping.verified_pairs < 20 * 19 / 2 / 2


def test_clips_that_show_the_same_are_joined_by_what_looks_alike(tmp_path):
    """The same street filmed twice, the second time backwards and with a cut."""
    centers = np.concatenate([street(14), street(14)[::-1] + np.array([0, 0.2, 0])])
    clips = [*filmed(14), *filmed(7, "b.mp4"), *filmed(7, "b.mp4", 1)]
    mapping = mapped(*walked(tmp_path, centers), clips, 90)
    assert (mapping.matcher, mapping.registered) == ("sequential and retrieval", 28)


def test_many_photographs_without_an_order_are_matched_with_those_that_look_alike(tmp_path):
    shuffled = np.random.default_rng(1).permutation(30)
    names = named([f"{index**2}" for index in range(30)])
    mapping = mapped(*walked(tmp_path, street(30)[shuffled]), names, 10)
    assert mapping.matcher.startswith("retrieval")
    assert mapping.registered == 30
    assert mapping.verified_pairs < 30 * 29 / 2 / 2


def test_what_a_sequence_leaves_out_is_matched_with_all(tmp_path):
    """A frame that shows something else stays without a camera, whatever is tried."""
    centers = np.insert(street(20), 9, [0, 90, 0], axis=0)
    mapping = mapped(*walked(tmp_path, centers), filmed(21), 10)
    assert mentions(mapping.mapper_reason, "20 of 21")
    assert "incremental" not in mapping.mapper_reason, "it shares nothing with any: minutes saved"
    assert mapping.registered == 20


def test_an_image_could_be_placed_that_shares_enough_with_a_model(tmp_path):
    centers = np.insert(street(8), 4, [0, 90, 0], axis=0)
    database, images = walked(tmp_path, centers)
    model = mapped(database, images, named([f"{k}" for k in range(9)]), 10).models[0]
    assert not could_be_placed(database, model)
    model.deregister_frame(model.image(1).frame_id)
    assert could_be_placed(database, model)


def test_a_capture_of_which_most_is_left_out_is_not_matched_all_with_all(tmp_path):
    """Of 150 photographs of which 2 belong together, 11,000 pairs took a quarter of an hour."""
    count = 60
    elsewhere = np.column_stack([np.zeros(count), 90.0 + 9 * np.arange(count), np.zeros(count)])
    centers = np.concatenate([street(6), elsewhere[6:]])
    database, images = walked(tmp_path, centers)
    mapping = mapped(database, images, named([f"{k**2}" for k in range(count)]), 10, 100)
    with closing(pycolmap.Database.open(database)) as opened:
        assert opened.num_matched_image_pairs() <= 3 * OVERLAP * count
    assert mapping.registered == 6


def test_bursts_of_more_photographs_than_neighbors_are_joined(tmp_path):
    """Each photograph shares the most with those of its own burst: no other was ever tried."""
    beside = np.random.default_rng(2).uniform(-0.1, 0.1, (2, 2 * OVERLAP + 4, 3))
    places = np.array([[0, 0, 0], [1.5, 0.1, 0]])
    centers = (places[:, None] + beside).reshape(-1, 3)
    database, images = walked(tmp_path, centers, points=400)
    count = len(centers)
    mapping = mapped(database, images, named([f"{k**2}" for k in range(count)]), 3, 100)
    assert mapping.registered == count


@pytest.mark.parametrize(("count", "times"), [(STRONGER_UP_TO, 1), (STRONGER_UP_TO + 1, 0)])
def test_stronger_features_are_not_awaited_for_many_photographs(tmp_path, count, times):
    elsewhere = np.column_stack([np.zeros(count), 90.0 + np.arange(count), np.zeros(count)])
    database, images = walked(tmp_path, np.concatenate([street(6), elsewhere[6:]]))
    described = []

    def describe(other):
        copyfile(database, other)
        described.append(other)

    names = named([f"{k**2}" for k in range(count)])
    settings = 10, 100, OVERLAP, 0, silent
    reconstruct(MappingTask(database, images, names, *settings, describe_stronger=describe))
    assert len(described) == times


def test_what_an_order_misplaces_is_found_by_its_looks(tmp_path):
    """A photograph from the middle of the street comes far from its neighbors."""
    centers = street(PATH)
    order = [index for index in range(PATH) if index != 7]
    order.insert(31, 7)
    mapping = mapped(*walked(tmp_path, centers[order]), frames(PATH), 10)
    assert (mapping.matcher, mapping.registered) == ("sequential and retrieval", PATH)


def test_the_largest_of_several_pieces_comes_first(tmp_path):
    """Two walks that see nothing in common; the incremental mapper is asked too."""
    centers = np.concatenate([street(PATH)[:6], street(PATH)[26:]])
    mapping = mapped(*walked(tmp_path, centers), frames(16), 90)
    assert mapping.registered == 10
    assert [model.num_reg_images() for model in mapping.models] == [10, 6]
    assert mentions(mapping.mapper_reason, "global", "incremental")


def test_few_photographs_count_the_points_of_two_where_those_of_three_explain_little(tmp_path):
    """Each sees its neighbors only, so that most points are seen twice."""
    centers = street(PATH)[:18:3]
    mapping = mapped(*walked(tmp_path, centers, points=3000), frames(6), 90)
    assert mapping.registered == 6
    assert mapping.explained > 0.8
    assert mentions(mapping.mapper_reason, "global", "two", "6 of 6")


def test_a_foreign_photograph_is_left_out_and_the_others_stay_where_they_are(tmp_path):
    """It sees the far end of the street, of which the others see nothing."""
    near = street(PATH)[:8]
    (tmp_path / "alone").mkdir()
    alone = mapped(*walked(tmp_path / "alone", near), frames(8), 90)
    (tmp_path / "among").mkdir()
    database, images = walked(tmp_path / "among", [*near[:4], street(PATH)[35], *near[4:]])
    among = mapped(database, images, frames(9), 90)
    assert (alone.registered, among.registered) == (8, 8)
    placed = {among.models[0].image(i).name for i in among.models[0].reg_image_ids()}
    assert "000004.png" not in placed
    assert among.explained > 0.95


def test_photographs_with_nothing_in_common_give_no_model(tmp_path):
    mapping = mapped(*walked(tmp_path, street(PATH)[::13]), frames(3), 90)
    assert (mapping.registered, mapping.verified_pairs) == (0, 0)


def test_photographs_with_nothing_in_common_are_matched_once(tmp_path):
    count = 20
    apart = np.column_stack([np.zeros(count), 90.0 + 9 * np.arange(count), np.zeros(count)])
    database, images = walked(tmp_path, apart)
    mapping = mapped(database, images, named([f"{k**2}" for k in range(count)]), 10, 100)
    assert (mapping.registered, mapping.verified_pairs) == (0, 0)
    assert "left out" not in mapping.mapper_reason


def test_three_photographs_are_enough(tmp_path):
    assert mapped(*walked(tmp_path, street(3)), frames(3), 90).registered == 3


def test_matches_that_the_model_does_not_explain_are_counted(tmp_path):
    """Half of the points of a good model taken away."""
    database, images = walked(tmp_path, street(8))
    mapping = mapped(database, images, frames(8), 8)
    assert mapping.explained > 0.95
    model = mapping.models[0]
    for point_id in list(model.points3D)[::2]:
        model.delete_point3D(point_id)
    assert explained_fraction(database, [model]) < 0.7
    assert explained_fraction(database, []) == 0
