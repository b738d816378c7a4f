import pycolmap
import pytest

from styletrf.sfm.mapping import SfmResult
from styletrf.sfm.mapping_ladder import MappingAttempt, best_mapping


class Model(pycolmap.Reconstruction):
    """Stands for a reconstruction of so many photographs."""

    def __init__(self, registered):
        super().__init__()
        self.registered = registered

    def num_reg_images(self):
        return self.registered


class Ladder:
    """Attempts that note that they were made."""

    def __init__(self, *steps):
        self.tried = []
        self.attempts = [self._attempt(f"way {k}", *step) for k, step in enumerate(steps)]

    def _attempt(self, name, registered, explained, *more):
        def attempt(best):
            self.tried.append(name)
            if registered is None:
                return None
            return SfmResult([Model(registered)], "", 1, name, "as usual", explained)

        return MappingAttempt(name, attempt, *more)


def test_the_first_attempt_that_explains_enough_is_the_last():
    ladder = Ladder((6, 0.9), (8, 0.7), (8, 0.8), (8, 1.0))
    best = best_mapping(ladder.attempts, 8)
    assert ladder.tried == ["way 0", "way 1", "way 2"]
    assert (best.mapper, best.registered) == ("way 2", 8)


def test_what_works_at_once_costs_nothing_more_and_keeps_its_reason():
    ladder = Ladder((8, 0.95), (8, 1.0))
    best = best_mapping(ladder.attempts, 8)
    assert ladder.tried == ["way 0"]
    assert best.mapper_reason == "as usual"


def test_each_attempt_is_in_the_one_line():
    ladder = Ladder((5, 0.5), (None, 0.0), (7, 0.6))
    best = best_mapping(ladder.attempts, 8)
    assert best.mapper_reason == (
        "way 0 placed 5 of 8 and explains 50% of their matches, "
        "way 2 placed 7 of 8 and explains 60% of their matches"
    )


def test_a_later_attempt_that_does_worse_is_not_believed():
    assert best_mapping(Ladder((6, 0.7), (5, 0.9), (6, 0.6)).attempts, 8).mapper == "way 0"


def test_few_photographs_in_right_places_are_better_than_more_in_wrong_ones():
    assert best_mapping(Ladder((3, 1.0), (4, 0.34)).attempts, 5).mapper == "way 0"


def test_of_two_that_explain_enough_the_one_with_more_photographs_is_better():
    assert best_mapping(Ladder((5, 1.0), (6, 0.85)).attempts, 8).mapper == "way 1"


@pytest.mark.parametrize(("placed", "is_tried"), [(8, False), (7, True)])
def test_a_long_way_is_left_out_where_enough_photographs_are_placed(placed, is_tried):
    ladder = Ladder((placed, 0.9), (10, 0.9, 0.8))
    best_mapping(ladder.attempts, 10)
    assert ("way 1" in ladder.tried) is is_tried


@pytest.mark.parametrize(
    ("placed", "explained", "is_kept"), [(10, 0.7, False), (10, 0.79, True), (7, 0.95, False)]
)
def test_an_attempt_that_needs_a_gain_is_kept_only_if_it_explains_clearly_more(
    placed, explained, is_kept
):
    """A lens for each photograph explains a little more in any case."""
    ladder = Ladder((10, 0.65), (placed, explained, 1.0, 1.2))
    assert (best_mapping(ladder.attempts, 10).mapper == "way 1") is is_kept


def test_an_attempt_receives_the_best_mapping_before_it():
    seen = []
    ladder = Ladder((6, 0.7), (5, 0.9))
    best_mapping([*ladder.attempts, MappingAttempt("last", lambda best: seen.append(best))], 8)
    assert [best.mapper for best in seen] == ["way 0"]


def test_a_ladder_with_nothing_to_try_is_refused():
    with pytest.raises(ValueError, match="attempt"):
        best_mapping(Ladder((None, 0.0)).attempts, 8)
