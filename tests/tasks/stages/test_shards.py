"""Frames and priors made in parts: the same bytes, and each part an artifact."""

from pathlib import Path

import pytest
from expected_errors import rejects

import tasks
from pipeline.digest import tree_digest
from pipeline.maintenance.task_graph import upstream_first
from styletrf.steps.sharding import shard_folders, shard_of

WORDS = {"scene": "mini", "quality": "draft"}
STYLE = {"style": "p", "content": "embedded"}


@pytest.mark.parametrize("count", [1, 2, 3, 7, 10])
def test_parts_have_every_frame_once_in_order_and_evenly(count):
    items = list(range(7))
    parts = [shard_of(items, f"{k}/{count}") for k in range(1, count + 1)]
    assert [item for part in parts for item in part] == items
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


def test_without_shards_there_are_no_parts():
    whole = tasks.TrajectoryFrames(**WORDS)
    assert not shard_folders({name: Path() for name in whole.requires()})
    assert shard_of([1, 2], whole.shard) == [1, 2]


@pytest.mark.parametrize(
    "family",
    [tasks.TrajectoryFrames, tasks.PriorRenders, tasks.StylizedPriors, tasks.StylizedFrames],
)
def test_parts_are_upstream_and_decide_nothing(family):
    words = WORDS | (STYLE if family in (tasks.StylizedPriors, tasks.StylizedFrames) else {})
    whole, sharded = family(**words), family(**words, shards=3)
    assert whole.task_id == sharded.task_id
    assert whole.identity_parameters() == sharded.identity_parameters()
    parts = [t for name, t in sharded.requires().items() if name.startswith("shard ")]
    assert [part.shard for part in parts] == ["1/3", "2/3", "3/3"]
    assert len({part.task_id for part in parts} | {whole.task_id}) == 4
    assert all(not p.shard_stages() and "1/3" not in p.identity_parameters() for p in parts)


def test_all_that_a_sharded_result_needs_is_sharded():
    """Else Luigi would meet one task in two forms, with parts and without."""
    result = tasks.StylizedTrajectory(**WORDS, **STYLE, shards=2)
    for task in upstream_first(result):
        assert task.shards == 2, task


@pytest.mark.parametrize("shard", ["0/3", "4/3", "1", "a/b", "/", "1/", "²/3"])
def test_what_is_no_part_is_refused(shard):
    with rejects(f"--shard {shard}", remedy=["2/5"]):
        tasks.TrajectoryFrames(**WORDS, shard=shard).validate()


def test_no_parts_at_all_are_refused():
    with rejects("--shards 0", 1):
        tasks.TrajectoryFrames(**WORDS, shards=0).validate()


@pytest.mark.parametrize(
    ("count", "family"),
    [
        (2, "TrajectoryFrames"),
        (2, "PriorRenders"),
        (2, "StylizedPriors"),
        (2, "StylizedFrames"),
        (9, "PriorRenders"),  # more than there are
        (9, "StylizedFrames"),
    ],
)
def test_what_is_put_together_is_the_same_byte_by_byte(mini, stage_of, build, family, count):
    whole = mini(family)
    part, inputs = stage_of(family)
    parts = {
        f"shard {k:04d}": build(part.clone(shard=f"{k}/{count}"), **inputs)
        for k in range(1, count + 1)
    }
    joined = build(part.clone(shards=count), **inputs, **parts)
    assert tree_digest(joined) == tree_digest(whole)
    files = {p.relative_to(f) for f in parts.values() for p in f.rglob("*") if p.is_file()}
    assert not any(file.suffix == ".mp4" for file in files), "a part is no video"


def test_parts_of_different_choices_are_not_put_together(stage_of, build, tmp_path):
    """A GPU and a core may choose other priors; their parts would overlap, or leave gaps."""
    part, inputs = stage_of("PriorRenders")
    words = {"coverage.count": 2}
    parts = {
        "shard 0001": build(part.clone(shard="1/2"), **inputs),
        "shard 0002": build(part.clone(shard="2/2", settings=words), **inputs),
    }
    with rejects("the parts", remedy=["--shards 1"]):
        build(part.clone(shards=2), **inputs, **parts)


def test_frames_painted_one_by_one_are_made_in_parts_too(mini, stage_of, build):
    words = {"method": "per-frame"}
    part, inputs = stage_of("StylizedFrames", **words)
    parts = {f"shard {k:04d}": build(part.clone(shard=f"{k}/2"), **inputs) for k in (1, 2)}
    joined = build(part.clone(shards=2), **inputs, **parts)
    assert tree_digest(joined) == tree_digest(mini("StylizedFrames", **words))
