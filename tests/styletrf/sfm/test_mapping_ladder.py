import pycolmap
import pytest

from styletrf.sfm.mapping import SfmResult
from styletrf.sfm.mapping_ladder import Rung, best_mapping


class Model(pycolmap.Reconstruction):
    """Stands for a reconstruction of so many photographs."""

    def __init__(self, registered):
        super().__init__()
        self.registered = registered

    def num_reg_images(self):
        return self.registered


class Ladder:
    """Rungs that note that they were tried."""

    def __init__(self, *steps):
        self.tried = []
        self.rungs = [self._rung(f"rung {k}", *step) for k, step in enumerate(steps)]

    def _rung(self, name, registered, explained, unless_placed=1.0):
        def attempt(best):
            self.tried.append(name)
            if registered is None:
                return None
            return SfmResult([Model(registered)], "", 1, name, "as usual", explained)

        return Rung(name, attempt, unless_placed)


def test_the_first_rung_that_explains_enough_is_the_last():
    ladder = Ladder((6, 0.9), (8, 0.7), (8, 0.8), (8, 1.0))
    best = best_mapping(ladder.rungs, 8)
    assert ladder.tried == ["rung 0", "rung 1", "rung 2"]
    assert (best.mapper, best.registered) == ("rung 2", 8)


def test_what_works_at_once_costs_nothing_more_and_keeps_its_reason():
    ladder = Ladder((8, 0.95), (8, 1.0))
    best = best_mapping(ladder.rungs, 8)
    assert ladder.tried == ["rung 0"]
    assert best.mapper_reason == "as usual"


def test_each_rung_that_was_tried_is_in_the_one_line():
    ladder = Ladder((5, 0.5), (None, 0.0), (7, 0.6))
    best = best_mapping(ladder.rungs, 8)
    assert best.mapper_reason == (
        "rung 0 placed 5 of 8 and explains 50% of their matches, "
        "rung 2 placed 7 of 8 and explains 60% of their matches"
    )


def test_a_later_rung_that_does_worse_is_not_believed():
    assert best_mapping(Ladder((6, 0.7), (5, 0.9), (6, 0.6)).rungs, 8).mapper == "rung 0"


def test_few_photographs_in_right_places_are_better_than_more_in_wrong_ones():
    assert best_mapping(Ladder((3, 1.0), (4, 0.34)).rungs, 5).mapper == "rung 0"


def test_of_two_that_explain_enough_the_one_with_more_photographs_is_better():
    assert best_mapping(Ladder((5, 1.0), (6, 0.85)).rungs, 8).mapper == "rung 1"


@pytest.mark.parametrize(("placed", "is_tried"), [(8, False), (7, True)])
def test_a_long_way_is_left_out_where_enough_photographs_are_placed(placed, is_tried):
    ladder = Ladder((placed, 0.9), (10, 0.9, 0.8))
    best_mapping(ladder.rungs, 10)
    assert ("rung 1" in ladder.tried) is is_tried


def test_a_rung_knows_the_best_before_it():
    seen = []
    ladder = Ladder((6, 0.7), (5, 0.9))
    best_mapping([*ladder.rungs, Rung("last", lambda best: seen.append(best))], 8)
    assert [best.mapper for best in seen] == ["rung 0"]


def test_a_ladder_without_a_rung_to_try_is_refused():
    with pytest.raises(ValueError, match="rung"):
        best_mapping(Ladder((None, 0.0)).rungs, 8)
