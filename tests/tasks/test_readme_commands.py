"""The commands of the README: each is parsed, and planned on a small scene."""

import re
import shlex
from pathlib import Path

import pytest
from documented_commands import documented_commands
from luigi.cmdline_parser import CmdlineParser

from pipeline.maintenance.task_graph import upstream_first
from tasks.machine.calibration import calibration_of_machine, keep_calibration, this_machine
from tasks.planning.build_plan import plan_of
from tasks.planning.stage_costs import reference_costs
from tasks.presets.quality_request import quality_request

README = (Path(__file__).parents[2] / "README.md").read_text()
NAMES = {
    "NAME": "mini", "horns": "mini", "fern": "other", "PAINTING": "p", "mosaic": "p", "udnie": "q",
    "FILE": "orbit", "PATH": "embedded",
}  # fmt: skip


def on_the_mini_scene(words: list[str]) -> list[str]:
    names = re.compile("|".join(rf"\b{name}\b" for name in NAMES))
    return [names.sub(lambda found: NAMES[found[0]], word) for word in words]


def commands() -> list[list[str]]:
    """Every command line of Luigi: in blocks, and in the text."""
    found = [each for each in documented_commands() if each.page == "README.md"]
    return [on_the_mini_scene(each.arguments) for each in found if each.subject == "luigi"]


def options() -> list[list[str]]:
    """Every option with its value in the table, for the main command."""
    rows = [row for row in README.splitlines() if row.startswith("| `--")]
    found = [each for row in rows for each in re.findall(r"`(--[^`]+)`", row.split(" | ")[0])]
    main = ["--module", "tasks", "StylizedTrajectory", "--scene", "mini", "--style", "p"]
    usual = ["--content", "embedded"]
    return [
        [*main, *([] if "--content" in option else usual), *on_the_mini_scene(shlex.split(option))]
        for option in found
        if option not in ("--blend", "--region")  # named there without a value
    ]


def test_the_readme_asks_for_time_and_for_accuracy():
    asked = [words for words in (*commands(), *options()) if "--budget" in words]
    assert asked
    assert any(
        quality_request(words[words.index("--quality") + 1], "")
        for words in options()
        if "--quality" in words
    )


@pytest.fixture
def _two_scenes(photographs, tmp_path, monkeypatch):
    """The mini scene by two names: a grid refuses a name that it has twice."""
    (tmp_path / "data" / "scenes").mkdir(parents=True)
    (tmp_path / "data" / "styles").symlink_to(photographs / "styles")
    for name in ("mini", "other"):
        (tmp_path / "data" / "scenes" / name).symlink_to(photographs / "scenes" / "mini")
    monkeypatch.setenv("STYLETRF_DATA", str(tmp_path / "data"))
    monkeypatch.setenv("STYLETRF_OUT", str(tmp_path / "out"))


@pytest.mark.usefixtures("_two_scenes")
@pytest.mark.parametrize("words", [*commands(), *options()], ids=" ".join)
def test_a_command_of_the_readme_can_be_planned(words):
    calibration_of_machine.cache_clear()
    keep_calibration(this_machine(), reference_costs().calibration.seconds)
    with CmdlineParser.global_instance(words) as command:
        root = command.get_task_obj()
    stages = list(upstream_first(root))
    assert len(stages) > 1
    for stage in stages:
        for check in ("validate", "require_reachable"):
            getattr(stage, check, lambda: None)()
    if hasattr(root, "cells"):
        assert plan_of(root).to_make
