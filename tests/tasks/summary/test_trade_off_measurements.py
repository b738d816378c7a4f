"""Measurements from records: lineages by digest, shares of other work, times of resumed builds."""

import socket
from pathlib import Path

import pytest
from message_words import mentions

from pipeline.digest import Tree
from pipeline.record import Action, ActionRecord
from tasks.presets.sweep import Variant
from tasks.summary.trade_off_measurements import consistency_ratio, lineage_of, machine, measurement


def record(family, digest, inputs=(), **provenance):
    action = Action(family, "code", {"made": digest}, dict(inputs), {}, {})
    costs = {"seconds": 10.0, "peak_memory_bytes": 5, "cpu_seconds": 9.0, "other_cpu_seconds": 0.0}
    return ActionRecord(action, Tree(digest, 100, 1), costs | provenance)


RECORDS = [
    record("SceneModel", "m"),
    record("RadianceField", "f", {"model": "m"}, seconds=60.0),
    record("RadianceField", "g", {"model": "m"}, seconds=30.0),
    record("StyleNetwork", "n", seconds=80.0),
    record("StylizedField", "s", {"field": "f", "network": "n"}),
    record("StylizationMetrics", "j", {"stylized": "s"}),
]


def test_a_lineage_is_what_went_into_an_artifact():
    found = lineage_of(Path("objects/s"), RECORDS)
    assert set(found) == {"m", "f", "n", "s"}
    assert set(lineage_of(Path("objects/g"), RECORDS)) == {"m", "g"}


def test_a_stage_made_in_parts_took_what_all_of_them_did():
    parts = [record("TrajectoryFrames", f"part{k}", seconds=20.0 + k) for k in range(2)]
    joined = record("TrajectoryFrames", "t", {"0": "part0", "1": "part1"}, seconds=1.0)
    lineage = lineage_of(Path("objects/t"), [*parts, joined]).values()
    measured = measurement(Variant("scene", "", {}), lineage, {"psnr": 25.0})
    assert measured.seconds == {"TrajectoryFrames": 42.0}


def test_measurements_of_another_host_name_it():
    own = machine([record("SceneModel", "m", host=socket.gethostname())])
    assert not mentions(own, socket.gethostname())
    description = machine(
        [record("SceneModel", "m", host="faraway", started="2026-01-02T03:04:05")]
    )
    assert mentions(description, "faraway")


def test_the_consistency_of_a_style_is_its_error_over_the_floor():
    nearest = {"normalized_error": 0.6, "normalized_floor": 0.5}
    assert consistency_ratio({"delta_1": nearest, "delta_5": {}}) == pytest.approx(1.2)
    for unknown in ({}, {"delta_1": nearest | {"normalized_error": None}},
                    {"delta_1": nearest | {"normalized_floor": 0.0}}):  # fmt: skip
        assert consistency_ratio(unknown) is None


def test_each_side_counts_its_own_stages_and_no_judge():
    lineage = lineage_of(Path("objects/j"), RECORDS).values()
    names = ("style_swd_patches_ratio", "style_swd_texture_ratio", "style_gram_ratio")
    judged = {"style_and_content": 10.0, **dict.fromkeys(names, 0.1)}
    style = measurement(Variant("style", "", {}, "arbitrary"), lineage, judged)
    assert style.stylizer == "arbitrary"
    assert style.seconds == {"StyleNetwork": 80.0, "StylizedField": 10.0}
    assert (style.loss_db, style.resemblance_db) == pytest.approx((-10, 10))
    assert style.quality_db == pytest.approx(0)
    assert style.model_bytes == {"StyleNetwork": 100, "StylizedField": 100}
    scene = measurement(Variant("scene", "", {}), lineage, {"psnr": 25.0})
    assert scene.seconds == {"SceneModel": 10.0, "RadianceField": 60.0}
    assert scene.quality_db == 25.0


@pytest.mark.parametrize(
    ("provenance", "fraction"),
    [({}, 0.0), ({"other_cpu_seconds": 6.0}, 0.3),
     ({"seconds": 2.0, "other_cpu_seconds": 2.0}, 0.0),
     ({"seconds": 110.0, "earlier_seconds": 100.0, "other_cpu_seconds": 6.0}, 0.3)],
    ids=["idle", "busy", "too short to tell", "of the last attempt"],
)  # fmt: skip
def test_the_share_of_other_work(monkeypatch, provenance, fraction):
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    lineage = [record("RadianceField", "f", **provenance)]
    measured = measurement(Variant("scene", "", {}), lineage, {"psnr": 25.0})
    assert measured.other_cpu_share == pytest.approx(fraction)


def test_records_that_do_not_tell_of_other_work_are_not_taken_for_idle():
    old = record("RadianceField", "f")
    del old.provenance["other_cpu_seconds"]
    measured = measurement(Variant("scene", "", {}), [old], {"psnr": 25.0})
    assert measured.other_cpu_share is None
