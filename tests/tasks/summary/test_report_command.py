"""The command in a report makes the very result that the report shows."""

import contextlib
import json
import shlex
from collections.abc import Iterator
from typing import Any

import pytest
from luigi.cmdline_parser import CmdlineParser

import tasks
from pipeline.canonical import canonical_json
from pipeline.digest import Tree
from pipeline.maintenance.task_graph import stored_tasks
from pipeline.record import Action, ActionRecord
from tasks.command.main_command import main_command
from tasks.planning.artifact_names import ArtifactNames
from tasks.summary.report_content import tuning_of

TUNING = {"RadianceField": {"iterations": 60}, "StyleNetwork": {"iterations": 7}}
CHANGED = f"--tuning '{json.dumps(TUNING)}'"
IMPLIED = [
    "",
    "--quality draft --path spiral --seconds 3 --frame-rate 30 --frame-size 640",
    "--path some/file.json",
    "--blend '{\"q\": 0.3}' --strength 0.5",
    "--network n.pth --blend '{\"q\": 0.3}'",
    "--strategy s1",
    "--strategy s2 --rounds 2",
    "--colors photograph --stroke-scale 2",
    "--stylizer gatys",
    "--method per-frame",
    "--quality paper --perceptual torchvision --transfer some.whl",
]


def record_of(stage) -> ActionRecord:
    parameters = json.loads(canonical_json(stage.identity_parameters()))
    return ActionRecord(Action(stage.task_family, "", parameters, {}, {}, {}), Tree("", 0, 0), {})


@contextlib.contextmanager
def requested(words: list[str]) -> Iterator[tuple[tasks.StylizedTrajectory, str]]:
    """The task of a command, and the name of its artifact."""
    with CmdlineParser.global_instance(words) as parser:
        task = parser.get_task_obj()
        yield task, ArtifactNames().of(task)


def shown(options: str) -> tuple[str, dict[str, Any], str]:
    """The name of a result, the tuning that its report shows, and the command there."""
    usual = "StylizedTrajectory --scene mini --style p --content embedded "
    with requested(shlex.split(usual + options)) as (task, name):
        lineage = [record_of(stage) for stage in stored_tasks(task) if stage is not task]
        parameters = task.identity_parameters()
    tuning = tuning_of(parameters, lineage)
    return name, tuning, main_command(parameters, tuning)


def made_again(command: str) -> str:
    """The name of the result of a shown command."""
    words = shlex.split(command)
    assert words[:3] == ["luigi", "--module", "tasks"]
    with requested(words[3:]) as (_, name):
        return name


@pytest.mark.parametrize("changed", ["", CHANGED], ids=["usual", "tuned"])
@pytest.mark.parametrize("options", IMPLIED)
def test_command_of_a_report_makes_the_same_result_and_names_what_was_changed(options, changed):
    name, tuning, command = shown(f"{options} {changed}")
    assert made_again(command) == name
    assert tuning.items() <= TUNING.items()
    assert ("RadianceField" in tuning) == bool(changed)


def test_settings_of_one_stage_are_shown_as_tuning():
    name, tuning, command = shown("--RadianceField-settings '{\"iterations\": 60}'")
    assert tuning == {"RadianceField": {"iterations": 60}}
    assert made_again(command) == name


def test_a_setting_that_another_one_implies_is_not_shown():
    """Renders that nothing moves need the sharper weights, which were shown as a change."""
    given = {"StylizedField": {"image.iterations": 0}}
    name, tuning, command = shown(f"--tuning '{json.dumps(given)}'")
    assert tuning == given
    assert made_again(command) == name
