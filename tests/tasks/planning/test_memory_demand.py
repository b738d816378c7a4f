"""A command that takes clearly more memory than there is stops before anything long begins."""

from dataclasses import replace
from math import nan

import numpy as np
import pytest
from command_output import CELL, said
from expected_errors import rejects
from message_words import mentions

import tasks
from pipeline.execution import cpu_memory
from pipeline.execution.cpu_memory import available_memory_bytes
from pipeline.maintenance.task_graph import upstream_first
from styletrf.errors import InputError
from styletrf.files.video import write_video
from tasks.planning import scene_sizes, stage_demands
from tasks.planning.memory_demand import (
    GROWTH,
    MARGIN,
    Demand,
    Photographs,
    predicted_bytes,
    require_memory,
)
from tasks.planning.scene_photographs import photographs_of
from tasks.planning.scene_sizes import sizes_of
from tasks.planning.stage_demands import demand_of, demands_of
from tasks.stages.path_parameters import frame_count

SCENE = Photographs(count=50, width=4000, height=3000)
DEMAND = Demand("ConsistencyMetrics", "yard", 504, 0, 224**3, 60, 0)
WORDS = {"scene": "mini", "style": "p", "quality": "draft", "content": "embedded"}


def taken(demand: Demand, photographs: Photographs = SCENE) -> float:
    return sum(predicted_bytes(demand, photographs).values())


@pytest.mark.parametrize("stage", GROWTH)
def test_nothing_takes_less_memory_where_there_is_more_of_anything(stage):
    demand = replace(DEMAND, stage=stage)
    assert taken(replace(demand, frame_px=3840)) >= taken(demand)
    assert taken(replace(demand, photograph_px=1008)) >= taken(demand)
    assert taken(replace(demand, prior_px=1008)) >= taken(demand)
    assert taken(replace(demand, grid_points=384**3)) >= taken(demand)
    assert taken(demand, replace(SCENE, count=500)) >= taken(demand)


def test_what_is_beside_the_libraries_grows_with_the_square_of_the_frames():
    parts = [predicted_bytes(replace(DEMAND, frame_px=px), SCENE) for px in (960, 1920)]
    assert parts[1]["frames"] == pytest.approx(4 * parts[0]["frames"])
    assert parts[1]["libraries"] == parts[0]["libraries"]


def test_photographs_count_at_the_size_they_are_worked_on():
    field = replace(DEMAND, stage="RadianceField")
    small = Photographs(50, 400, 300)
    assert taken(field, Photographs(50, 6000, 4500)) == taken(field, SCENE)
    assert taken(replace(field, photograph_px=9999), small) == taken(field, small)
    assert taken(field, Photographs(50, 3000, 4000)) == taken(field, SCENE), "standing, too"


def test_priors_count_at_their_own_size_and_never_above_the_photographs():
    field = replace(DEMAND, stage="StylizedField", prior_px=504)
    assert taken(replace(field, photograph_px=1008)) == taken(field)
    small = Photographs(50, 400, 300)
    assert taken(field, small) == taken(replace(field, prior_px=400), small)
    with rejects("1600", remedy=["long_side_px", "--PriorRenders-settings"]):
        require_memory([replace(field, prior_px=4000)], 1 << 30, {"yard": SCENE})


def test_refused_is_what_takes_clearly_more_than_is_available():
    demand = replace(DEMAND, frame_px=3840)
    enough = int(taken(demand) / MARGIN) + 1
    require_memory([demand], enough, {"yard": SCENE})
    with pytest.raises(InputError) as refused:
        require_memory([demand], enough // 2, {"yard": SCENE})
    message = str(refused.value)
    for word in ("ConsistencyMetrics", "yard", "3840", "--frame-size"):
        assert word in message
    assert f"{taken(demand) / 2**30:.1f} GiB" in message
    assert f"{enough // 2 / 2**30:.1f} GiB" in message
    assert "\n" not in message


def test_the_stage_with_the_largest_demand_is_named():
    large = replace(DEMAND, stage="RadianceField", grid_points=640**3)
    with rejects("RadianceField", remedy=["max_voxels"]):
        require_memory([DEMAND, large], 1 << 20, {"yard": SCENE})


def test_what_the_user_allows_a_stage_counts_as_available():
    with pytest.raises(InputError):
        require_memory([replace(DEMAND, limit_bytes=1 << 20)], 1 << 40, {"yard": SCENE})


def test_a_scene_that_cannot_be_read_is_left_to_its_own_stage(photographs, monkeypatch):
    monkeypatch.setenv("STYLETRF_DATA", str(photographs))
    assert photographs_of("nowhere", 60) is None
    assert photographs_of("mini", 60) == Photographs(8, 96, 96)
    require_memory([DEMAND], 1, {})


def test_sizes_are_those_of_the_scenes_that_can_be_read(photographs, monkeypatch):
    monkeypatch.setenv("STYLETRF_DATA", str(photographs))
    assert sizes_of(("mini", "nowhere")) == {"mini": photographs_of("mini", 60)}


@pytest.mark.parametrize("answer", ["", "a library ended the process"])
def test_sizes_are_unknown_if_the_process_answers_nothing(monkeypatch, answer):
    monkeypatch.setattr(scene_sizes, "output_of", lambda *_: answer)
    assert sizes_of((f"a scene that is read once: {answer}",)) == {}


def test_demands_are_those_of_the_command(out):
    demands = demands_of(upstream_first(tasks.StylizedTrajectory(**WORDS, frame_size=1920)))
    by_stage = {demand.stage: demand for demand in demands}
    assert set(by_stage) == {name for name in GROWTH if " " not in name}
    assert {by_stage[name].frame_px for name in by_stage if GROWTH[name].frame} == {1920}
    assert {demand.photograph_px for demand in demands} == {504}
    painted = demands_of(upstream_first(tasks.StylizedTrajectory(**WORDS, method="per-frame")))
    assert "StylizedFrames per-frame" in {demand.stage for demand in painted}


def test_stages_that_have_one_artifact_demand_it_once(out):
    """A sweep was refused for the frames of each of its variants, which have the same."""
    variants = [
        tasks.StylizedTrajectory(**WORDS, tuning={"StyleNetwork": {"iterations": iterations}})
        for iterations in (7, 8)
    ]
    found = [demand.stage for demand in demands_of(upstream_first(*variants))]
    assert found.count("TrajectoryFrames") == 1
    assert found.count("StylizedFrames") == 2


@pytest.mark.parametrize(
    ("words", "stage"),
    [
        ({"match": "pixels"}, "StylizedField pixels"),
        ({"colors": "photograph"}, "StylizedField pixels"),
        ({"quality": "paper", "perceptual": "torchvision"}, "StylizedField pixels"),
        ({"strategy": "s1"}, "StylizedField s1"),
        ({"strategy": "s2"}, "StylizedField s2"),
    ],
)
def test_a_fit_to_pixels_and_one_with_its_own_density_have_demands_of_their_own(out, words, stage):
    """They were never checked, and plans showed the memory of another computation."""
    graph = upstream_first(tasks.StylizedTrajectory(**WORDS | words))
    fields = [demand for demand in demands_of(graph) if "StylizedField" in demand.stage]
    assert [demand.stage for demand in fields] == [stage]


def fitted_to_pixels(quality, **settings):
    words = {"scene": "yard", "style": "p", "match": "pixels"}
    return demand_of(tasks.StylizedField(quality=quality, settings=settings, **words))


def test_a_fit_to_all_rays_of_the_priors_counts_them(out):
    owned, all_rays = (fitted_to_pixels("draft", single_owner=owner) for owner in (True, False))
    assert (owned.rays, all_rays.rays) == (0, 300 * 16384)
    assert taken(all_rays) > 2 * taken(owned)
    few = replace(all_rays, priors=1)
    assert taken(owned) < taken(few) < taken(all_rays), "which have no more rays than pixels"


def test_an_adaptation_keeps_no_more_rays_than_its_cache_holds(out):
    demand = fitted_to_pixels("paper", **{"adaptation.cache_bytes": 1 << 30})
    assert demand.rays * demand.ray_bytes == pytest.approx(1 << 30, rel=1e-3)


@pytest.mark.parametrize(
    ("stage", "measured_mib"), [("StylizedField s1", 1001), ("StylizedField s2", 853)]
)
def test_predictions_are_near_what_was_measured(stage, measured_mib):
    """The kitchen at `draft` (benchmarks/history.md)."""
    demand, small = replace(DEMAND, stage=stage), Photographs(62, 504, 378)
    assert taken(demand, small) / 2**20 == pytest.approx(measured_mib, rel=0.25)


@pytest.mark.parametrize(
    ("quality", "is_owned", "priors", "measured_mib"),
    [("draft", True, 13, 905), ("draft", False, 13, 1662), ("paper", False, 30, 6485)],
)
def test_predictions_of_fits_to_pixels_are_near_what_was_measured(
    quality, is_owned, priors, measured_mib, out
):
    """Horns (benchmarks/history.md)."""
    demand = replace(fitted_to_pixels(quality, single_owner=is_owned), priors=priors)
    demand = replace(demand, photograph_px=504, prior_px=504)
    small = Photographs(62, 504, 378)
    assert taken(demand, small) / 2**20 == pytest.approx(measured_mib, rel=0.15)


def test_a_demand_counts_the_frames_that_a_slower_path_has(out):
    """Frames were counted as if every path had a speed of 1."""
    slow = {"trajectory.frames": 60, "trajectory.speed": 0.5}
    stage = tasks.TrajectoryFrames(scene="yard", settings=slow)
    assert demand_of(stage).frames == 120


@pytest.mark.parametrize("settings", [{"trajectory.frames": "many"}, {"trajectory.seconds": nan}])
def test_frames_by_settings_that_are_no_numbers_are_left_to_the_validation(settings):
    assert frame_count(settings) is None


@pytest.mark.parametrize("gpus", [[], ["GPU-a"]])
def test_the_demands_of_a_command_ask_for_the_gpus_once(out, monkeypatch, gpus):
    """`nvidia-smi` ran for each stage that computes on a GPU."""
    calls = []
    monkeypatch.setattr(stage_demands, "visible_gpus", lambda: calls.append(1) or gpus)
    styles = (tasks.StylizedTrajectory(**WORDS | {"style": style}) for style in "pq")
    demands = demands_of(upstream_first(*styles))
    assert len(calls) == 1
    assert ("RadianceField" in {demand.stage for demand in demands}) is not bool(gpus)
    assert demands_of([]) == []


def test_a_command_stops_with_one_line_unless_it_keeps_going(photographs):
    words = ["StylizedTrajectory", *CELL, "--RadianceField-memory-gib", "0.01"]
    status, screen = said(photographs, *words)
    assert status == 1
    assert screen.startswith("RadianceField ")
    assert mentions(screen, "mini", "GiB", "--keep-going")
    assert screen.count("\n") == 1


def test_keep_going_does_not_look_at_memory(out):
    from tasks.command.sources import may_stop

    root = tasks.StylizedTrajectory(**WORDS)
    assert may_stop(root)
    assert not may_stop(root.clone(keep_going=True))


def test_available_is_what_the_group_of_the_container_leaves(tmp_path, monkeypatch):
    monkeypatch.setattr(cpu_memory, "_CGROUP", tmp_path)
    free = available_memory_bytes()
    (tmp_path / "memory.max").write_text(f"{1 << 29}\n")
    (tmp_path / "memory.current").write_text(f"{1 << 28}\n")
    assert available_memory_bytes() == 1 << 28
    (tmp_path / "memory.stat").write_text(f"anon 5\ninactive_file {1 << 27}\n")
    assert available_memory_bytes() == (1 << 28) + (1 << 27)
    (tmp_path / "memory.max").write_text("max\n")
    assert available_memory_bytes() == pytest.approx(free, rel=0.2)


def test_a_video_counts_the_frames_that_are_chosen_and_the_pixels_of_all(tmp_path, monkeypatch):
    monkeypatch.setenv("STYLETRF_DATA", str(tmp_path))
    (tmp_path / "scenes" / "walk").mkdir(parents=True)
    write_video(tmp_path / "scenes" / "walk" / "a.mp4", np.zeros((5, 16, 32, 3), np.uint8), 12)
    write_video(tmp_path / "scenes" / "walk" / "b.mp4", np.zeros((4, 16, 32, 3), np.uint8), 12)
    assert photographs_of("walk", 60) == Photographs(60, 32, 16, 9 * 32 * 16)
