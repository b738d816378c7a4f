"""What steers a style changes the stages it is about, and what cannot be is refused in words."""

import pytest
from test_graph import WORDS, key_words

import tasks
from styletrf.errors import InputError

WHERE = {  # a control: the first stages that it changes
    "stroke_scale": (2.0, {"StyleNetwork"}),
    "content_weight": (0.5, {"StyleNetwork"}),
    "colors": ("luminance", {"StylizedPriors"}),
    "strategy": ("s2", {"StylizedField"}),
    "match": ("gram", {"StylizedField"}),
    "strength": (0.5, {"StylizedFrames"}),
    "blend": ({"udnie": 0.3}, {"StylizedFrames"}),
    "region": ({"box": [[0, 0, 0], [1, 1, 1]]}, {"StylizedFrames"}),
}


@pytest.mark.parametrize("name", WHERE)
def test_a_control_changes_the_stages_it_is_about(name):
    value, stages = WHERE[name]
    before = key_words(tasks.StylizedTrajectory(content="embedded", **WORDS))
    after = key_words(tasks.StylizedTrajectory(content="embedded", **WORDS, **{name: value}))
    changed = {family for family in before if before[family] != after[family]}
    assert changed == stages | {"StylizedTrajectory"}


def families_above(task, seen=None) -> set[str]:
    seen = set() if seen is None else seen
    for stage in task.requires().values():
        seen.add(stage.task_family)
        families_above(stage, seen)
    return seen


def test_what_is_not_needed_is_not_made():
    cell = {"content": "embedded", **WORDS}
    gatys = families_above(tasks.StylizedTrajectory(stylizer="gatys", **cell))
    assert "StyleNetwork" not in gatys
    per_frame = families_above(tasks.StylizedTrajectory(method="per-frame", **cell))
    assert not {"StylizedField", "StylizedPriors", "PriorRenders"} & per_frame
    given = tasks.StyleNetwork(network="mosaic.pth", **cell)
    assert given.requires() == {}


def test_each_round_paints_what_the_one_before_left():
    third = tasks.StylizedField(rounds=3, content="embedded", **WORDS)
    painted = third.requires()["stylized"]
    assert painted.requires()["before"].rounds == 2
    first = painted.requires()["before"].requires()["stylized"].requires()["before"]
    assert first.rounds == 1
    assert "before" not in first.requires()["stylized"].requires()


def test_blended_styles_are_adapted_with_the_same_words():
    frames = tasks.StylizedFrames(blend={"udnie": 0.3}, colors="luminance", **WORDS)
    blended = frames.requires()["blend udnie"]
    assert (blended.style, blended.colors) == ("udnie", "luminance")
    assert frames.requires()["stylized"].style == "mosaic"


@pytest.mark.parametrize(
    ("family", "words", "told"),
    [
        ("StylizedFrames", {"strength": 1.5}, "--strength 1.5 is no share"),
        ("StylizedFrames", {"strength": float("nan")}, "--strength nan is no share"),
        ("StylizedFrames", {"blend": {"udnie": 1.0}}, "shares that are none"),
        ("StylizedFrames", {"blend": {"udnie": "much"}}, "shares that are none"),
        ("StylizedFrames", {"region": {"ball": 3}}, "is no region"),
        ("StylizedFrames", {"region": {"box": [[0, 0, 0], [1, 1, 0]]}}, "is no region"),
        ("StylizedFrames", {"region": {"view": "0001", "mask": "no.png"}}, "no such file"),
        ("StylizedFrames", {"strategy": "s2", "strength": 0.5}, "share"),
        ("StylizedFrames", {"method": "per-frame", "blend": {"udnie": 0.3}}, "share"),
        ("StylizedField", {"rounds": 0}, "paints nothing"),
        ("StylizedField", {"strategy": "s1", "match": "gram"}, "only s3"),
        ("StyleNetwork", {"stroke_scale": 0.0}, "no positive factor"),
        ("StyleNetwork", {"content_weight": float("inf")}, "no positive factor"),
        ("StyleNetwork", {"network": "no.pth"}, "no such file"),
    ],
)
def test_what_cannot_be_is_refused_in_words(family, words, told):
    stage = getattr(tasks, family)(**WORDS, **words)
    with pytest.raises(InputError) as error:
        stage.require_sound()
    assert told.split()[-1] in str(error.value)
    assert error.value.remedy
