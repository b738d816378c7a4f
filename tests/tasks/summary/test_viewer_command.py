"""The command of a viewer in a report asks for the very field that the report shows."""

import shlex
from typing import Any

import pytest
from luigi.cmdline_parser import CmdlineParser

import tasks
from tasks.summary.report_content import viewer_command

WORDS = {"scene": "mini", "style": "a p", "quality": "draft", "content": "embedded"}


@pytest.mark.parametrize(
    "controls",
    [
        {},
        {"stroke_scale": 2.0, "content_weight": 0.5, "colors": "photograph"},
        {"match": "gram", "rounds": 2, "path": "orbit", "seconds": 3.0, "frame_rate": 30},
        {"strength": 0.5, "tuning": {"RadianceField": {"iterations": 60}}},
    ],
)
def test_the_command_of_a_viewer_requests_the_same_field(out, controls: dict[str, Any]):
    report = tasks.StylizedTrajectory(**WORDS, **controls)
    command = viewer_command(report.identity_parameters(), controls.get("tuning", {}))
    words = shlex.split(command)
    assert words[:4] == ["luigi", "--module", "tasks", "Viewer"]
    with CmdlineParser.global_instance(words[1:]) as parser:
        viewer = parser.get_task_obj()
        viewer.validate()
        assert viewer.requires()["stylized a p"] == report.requires()["adaptation"]
        assert viewer.requires()["trajectory"] == report.requires()["trajectory"]


@pytest.mark.parametrize(
    "controls", [{"method": "per-frame"}, {"strategy": "s1"}, {"strategy": "s2"}]
)
def test_what_no_viewer_shows_has_no_command(out, controls: dict[str, Any]):
    report = tasks.StylizedTrajectory(**WORDS, **controls)
    assert viewer_command(report.identity_parameters(), {}) == ""
