"""`--plan`: what a command would do, without doing it."""

import itertools
import json
import re
import shutil
from pathlib import Path

import pytest
from command_output import command
from hypothesis import given
from hypothesis import strategies as st
from message_words import mentions

import tasks
from pipeline.settings import current_store
from tasks.machine.calibration import keep_calibration, this_machine
from tasks.planning.build_plan import BuildPlan, StagePlan, makespan, most_at_once, plan_of
from tasks.planning.plan_report import plan_as_json, plan_as_text
from tasks.planning.stage_costs import ExpectedCost, reference_costs
from tasks.presets.quality_choice import SHIPPED


@pytest.fixture(autouse=True)
def _calibrated(out):
    keep_calibration(this_machine(), reference_costs().calibration.seconds)


def image(style="p", **words):
    return tasks.StyleImage(style=style, **words)


def mini(**words):
    usual = {"scene": "mini", "style": "p", "quality": "draft", "content": "embedded"}
    return tasks.StylizedTrajectory(**usual | words)


def made(root) -> set[str]:
    return {stage.task.task_family for stage in plan_of(root).to_make}


def contents(store: Path) -> set[str]:
    folders = ("objects", "actions", "logs", "resume", "costs")
    return {str(path) for folder in folders for path in (store / folder).rglob("*")}


def test_a_plan_builds_nothing(tmp_path):
    store = current_store().root
    before = contents(store)
    plan = plan_of(mini())
    assert len(plan.to_make) == len(plan.stages) > 15
    assert all(stage.reasons and stage.cost.seconds > 0 for stage in plan.to_make)
    assert contents(store) == before
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("inline")
def test_what_was_made_is_found_and_a_changed_parameter_is_named():
    capture = tasks.SceneCapture(scene="mini")
    capture.run()
    image().run()
    assert made(mini()) & {"SceneCapture", "StyleImage"} == set()
    changed = mini(tuning={"SceneCapture": {"leave_out": ["a.png"]}})
    (stage,) = (s for s in plan_of(changed).stages if s.task.task_family == "SceneCapture")
    assert any("leave_out" in reason for reason in stage.reasons)


@pytest.mark.usefixtures("inline")
def test_a_scene_of_other_photographs_is_new_and_an_exchanged_photograph_is_named(
    photographs, tmp_path, monkeypatch
):
    data = shutil.copytree(photographs, tmp_path / "data")
    monkeypatch.setenv("STYLETRF_DATA", str(data))

    def reasons(scene: str) -> list[str]:
        stages = plan_of(mini(scene=scene)).stages
        return [r for s in stages if s.task.task_family == "SceneCapture" for r in s.reasons]

    of_the_first = reasons("mini")
    tasks.SceneCapture(scene="mini").run()
    images = data / "scenes/mini/images"
    exchanged = shutil.copytree(images, data / "scenes/exchanged/images")
    shutil.copy(images / "b.png", exchanged / "a.png")
    new = shutil.copytree(images, data / "scenes/new/images")
    for image in list(new.iterdir()):
        image.rename(new / f"new_{image.name}")

    (of_the_new,) = reasons("new")
    assert of_the_new not in of_the_first
    assert ".png" not in of_the_new
    assert any("a.png" in reason for reason in reasons("exchanged"))


@pytest.mark.usefixtures("inline")
def test_a_plan_of_a_finished_command_has_nothing_to_make():
    class Shown:
        """A command that asks for an image alone."""

        def cells(self):
            return [self]

        def planned(self):
            image().run()
            task = image()
            task.scene = "mini"
            return task, "", None

    plan = plan_of(Shown())
    assert plan.to_make == []
    assert plan.seconds(1, 2) == plan.seconds(4, 2) == 0
    assert json.loads(plan_as_json(plan))["totals"]["to_make"] == 0
    assert mentions(plan_as_text(plan).splitlines()[-1], 0)


def test_what_cells_of_a_grid_share_is_planned_once():
    grid = tasks.Grid(scenes=["mini"], styles=["p", "q"], quality="draft", content="embedded")
    families = [stage.task.task_family for stage in plan_of(grid).stages]
    assert families.count("RadianceField") == 1
    assert families.count("StyleNetwork") == families.count("StylizedTrajectory") == 2


def test_the_plan_of_a_budget_is_that_of_the_settings_chosen():
    plan = plan_of(mini(quality="standard", budget="3min"))
    (settings,) = plan.settings
    (field,) = (s.task for s in plan.stages if s.task.task_family == "RadianceField")
    assert field.quality == "draft"
    shipped = (json.loads(path.read_text()) for path in SHIPPED.glob("*.json"))
    assert any(mentions(settings, front["scene"], front["measured"]) for front in shipped)
    assert mentions(settings, "unknown"), "the kind of space is not known"


@pytest.mark.parametrize(
    "words", [{"budget": "3min"}, {"budget": "9h"}, {"quality": "within 1 dB"}]
)
def test_the_time_of_a_choice_is_that_of_its_stages(words):
    """The front said 417 s, and the total by the reference 299 s."""
    plan = plan_of(mini(**{"quality": "standard", **words}))
    (seconds,) = re.findall(r"about (\d+) s", *plan.settings)
    assert plan.seconds(1, 2) == pytest.approx(float(seconds), abs=0.5)


def test_json_says_what_the_lines_say():
    plan = plan_of(mini())
    fields = json.loads(plan_as_json(plan))
    lines = plan_as_text(plan).splitlines()
    assert len(fields["stages"]) == len(lines) - 1
    assert all(s["task"] in line for s, line in zip(fields["stages"], lines, strict=False))
    assert fields["totals"]["seconds"] == pytest.approx(
        sum(stage["seconds"] for stage in fields["stages"])
    )


graphs = st.lists(
    st.tuples(st.floats(0.0, 100.0), st.sets(st.integers(0, 20))), min_size=1, max_size=12
)


@given(graphs, st.integers(1, 6), st.floats(0.2, 2.0))
def test_more_workers_never_take_longer_than_one(rows, workers, busy):
    durations = {
        str(k): (seconds, [str(u) for u in upstream if u < k])
        for k, (seconds, upstream) in enumerate(rows)
    }
    total = sum(seconds for seconds, _ in durations.values())
    assert makespan(durations, 1) == pytest.approx(total)
    assert makespan(durations, workers) <= total * (1 + 1e-9)
    assert makespan(durations, workers) >= total / workers * (1 - 1e-9)
    costs = [ExpectedCost(s, busy * s, 1, 1, "the reference") for s, _ in rows]
    stages = [
        StagePlan(tasks.StyleImage(style=f"{k}"), ("new",), cost) for k, cost in enumerate(costs)
    ]
    plan = BuildPlan(stages, ())
    assert plan.seconds(workers, 2) <= plan.seconds(1, 2) * (1 + 1e-9)


@given(graphs, st.integers(1, 4))
def test_memory_is_at_least_that_of_any_stages_that_run_at_once(rows, workers):
    sizes = {str(k): round(size) for k, (size, _) in enumerate(rows)}
    upstream = {str(k): [str(u) for u in before if u < k] for k, (_, before) in enumerate(rows)}
    ahead = {}
    for name, waits_for in upstream.items():
        ahead[name] = set(waits_for).union(*(ahead[each] for each in waits_for))
    sums = [
        sum(sizes[name] for name in group)
        for count in range(1, workers + 1)
        for group in itertools.combinations(sizes, count)
        if not any(set(group) & ahead[name] for name in group)
    ]
    most = most_at_once(sizes, upstream, workers)
    assert max(sums) <= most <= sum(sorted(sizes.values())[-workers:])
    assert most == max(sums) or workers > 2


def test_totals_of_several_workers_have_the_memory_of_builds_at_once(monkeypatch):
    plan = plan_of(mini())
    largest = max(stage.cost.peak_memory_bytes for stage in plan.to_make)
    assert json.loads(plan_as_json(plan))["totals"]["peak_memory_bytes"] == largest
    monkeypatch.setattr("tasks.planning.plan_report.workers_of_command", lambda: 3)
    totals = json.loads(plan_as_json(plan))["totals"]
    assert totals["peak_memory_bytes_one_worker"] == largest
    assert largest < totals["peak_memory_bytes"] <= 3 * largest
    shown = [round(totals[name] / 2**20) for name in totals if "memory" in name]
    assert mentions(plan_as_text(plan).splitlines()[-1], *shown)


WORDS = ("--scene", "mini", "--style", "p", "--content", "embedded", "--quality", "draft")


def test_the_command_prints_the_plan_and_ends_with_status_0(tmp_path):
    done = command("--module", "tasks", "StylizedTrajectory", *WORDS, "--plan", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["totals"]["found"] == 0
    assert list((current_store().root / "objects").iterdir()) == []
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "words", [("--device", "cuda"), ("--tuning", '{"RadianceField": {"iteration": 5}}')]
)
def test_what_the_command_would_refuse_its_plan_refuses(words):
    done = command("--module", "tasks", "StylizedTrajectory", *WORDS, "--plan", *words)
    assert done.returncode == 1
    assert done.stdout == ""
