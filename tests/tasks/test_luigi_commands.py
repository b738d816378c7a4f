"""The commands of Luigi in the documentation: none is refused on a small scene, none builds."""

import json
import re
import shlex
from collections.abc import Sequence
from pathlib import Path

import pytest
from documented_commands import PAGES, ROOT, documented_commands
from luigi.cmdline_parser import CmdlineParser
from luigi.task_register import TaskClassException
from request_checks import check_in_this_process

from styletrf.configuration import configured
from tasks.command_line import begin
from tasks.machine.calibration import calibration_of_machine, keep_calibration, this_machine
from tasks.planning.request_validation import configurations
from tasks.planning.stage_costs import reference_costs
from tasks.presets.quality_request import quality_request

README = (ROOT / "README.md").read_text(encoding="utf-8")
NAMES = {
    "NAME": "mini", "SCENE": "mini", "S": "mini", "horns": "mini", "fern": "other",
    "PAINTING": "p", "mosaic": "p", "candy": "p", "udnie": "q",
    "FILE": "orbit", "PATH": "embedded", "Q": "draft", "T": "{}", "VALUE": "1",
}  # fmt: skip
"""What stands for the names and placeholders of the documentation."""
WORDS = {
    "$SCENES": ['["mini","other"]'],
    "$STYLES": ['["p","q"]'],
    "$UNTIL": ["2026-11-23T06:00"],
    "$k/100": ["1/2"],
    "...": ["--scenes", '["mini"]', "--styles", '["p"]'],
}
OF_PLACEHOLDERS_ALONE = (["--module"], ["--module", "tasks"], ["--module", "tasks", "..."])


def on_the_mini_scene(words: Sequence[str]) -> tuple[str, ...]:
    names = re.compile("|".join(rf"\b{name}\b" for name in NAMES))
    given = [part for word in words for part in WORDS.get(word, [word])]
    return tuple(names.sub(lambda found: NAMES[found[0]], word) for word in given)


def commands() -> list[tuple[str, ...]]:
    """Every command line of Luigi: in blocks, and in the text."""
    found = [each.arguments for each in documented_commands() if each.subject == "luigi"]
    return [on_the_mini_scene(words) for words in found if words not in OF_PLACEHOLDERS_ALONE]


def options() -> list[tuple[str, ...]]:
    """Every option with its value in the table of the README, for the main command."""
    rows = [row for row in README.splitlines() if row.startswith("| `--")]
    found = [each for row in rows for each in re.findall(r"`(--[^`]+)`", row.split(" | ")[0])]
    main = ("--module", "tasks", "StylizedTrajectory", "--scene", "mini", "--style", "p")
    return [
        (*main, *on_the_mini_scene(shlex.split(option)))
        for option in found
        if option not in ("--blend", "--region")  # named there without a value
    ]


def deployed() -> list[tuple[str, ...]]:
    """The commands of the systemd unit and of the container, with the values of `styletrf.env`."""
    names = "styletrf-grid.service", "compose.yaml", "styletrf.env"
    unit, container, values = (
        (ROOT / "deploy" / name).read_text(encoding="utf-8") for name in names
    )
    given = dict(re.findall(r"^(\w+)=(.*)$", values, re.MULTILINE))
    (of_unit,) = re.findall(r"^ExecStart=\S+ -m (.*)$", unit.replace("\\\n", ""), re.MULTILINE)
    (of_container,) = re.findall(r"^ +- -m\n((?: +- .*\n)+)", container, re.MULTILINE)
    return [
        on_the_mini_scene(
            ["--module", *(re.sub(r"\$\{(\w+)[^}]*\}", lambda v: given[v[1]], w) for w in words)]
        )
        for words in (of_unit.split(), re.findall(r"- (.*)", of_container))
    ]


def settings() -> list[tuple[str, str]]:
    """Every stage with settings that a page of today names, as JSON."""
    pages = [page.read_text(encoding="utf-8") for page in PAGES if page.parent.name != "decisions"]
    named = re.compile(r"--(?:(\w+)-settings|tuning) '(\{[^']+\})'")
    given = [each for page in pages for each in named.findall(page) if "{...}" not in each[1]]
    stages = [{name: json.loads(v)} if name else json.loads(v) for name, v in given]
    return [(name, json.dumps(of)) for each in stages for name, of in each.items()]


def test_the_readme_asks_for_time_and_for_accuracy():
    asked = [words for words in options() if "--budget" in words]
    assert asked
    assert any(
        quality_request(words[words.index("--quality") + 1], "")
        for words in options()
        if "--quality" in words
    )


@pytest.mark.parametrize(("stage", "values"), dict.fromkeys(settings()))
def test_documented_settings_exist(stage: str, values: str):
    assert configured(configurations()[stage], json.loads(values))


@pytest.fixture(scope="module")
def workplace(photographs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The mini scene by two names, since a grid refuses a name that it has twice."""
    root = tmp_path_factory.mktemp("workplace")
    (root / "data" / "scenes").mkdir(parents=True)
    (root / "data" / "styles").symlink_to(photographs / "styles")
    for name in ("mini", "other"):
        (root / "data" / "scenes" / name).symlink_to(photographs / "scenes" / "mini")
    return root


@pytest.fixture
def _at_work(workplace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All commands have one store, which knows how fast this machine is."""
    for name in ("data", "store", "out"):
        monkeypatch.setenv(f"STYLETRF_{name.upper()}", str(workplace / name))
    check_in_this_process(monkeypatch)
    monkeypatch.setattr("tasks.command_line.progress_client", lambda: None)  # no build follows
    if not (workplace / "store").exists():
        calibration_of_machine.cache_clear()
        keep_calibration(this_machine(), reference_costs().calibration.seconds)


def refusal(words: Sequence[str]) -> str:
    """Returns why a command is refused before its first stage; "" if it is not.

    No photograph is read, and neither weights nor memory are checked: a machine may lack them.
    """
    try:
        with CmdlineParser.global_instance([*words, "--keep-going"]) as parser:
            begin(parser.get_task_obj())
    except (SystemExit, TaskClassException) as ended:
        return str(getattr(ended, "code", ended) or "")  # the status is 0 after a plan
    return ""


COMMANDS = list(dict.fromkeys([*commands(), *options(), *deployed()]))


@pytest.mark.usefixtures("_at_work")
@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_a_documented_command_is_not_refused(words: Sequence[str]):
    assert refusal(words) == ""


@pytest.mark.usefixtures("_at_work", "capfd")
@pytest.mark.parametrize(
    "wrong",
    [
        ["Grids"],
        ["SceneReport", "--scenes", "mini"],
        ["QualityMetrics", "--scene", "mini", "--RadianceField-settings", '{"iteration": 3}'],
        ["CameraPoses", "--scene", "mini", "--tuning", '{"Poses": {}}'],
        ["Grid", "--scenes", '["mini","mini"]', "--styles", '["p"]'],
    ],
    ids=" ".join,
)
def test_a_task_parameter_setting_or_value_that_does_not_exist_is_noticed(wrong: list[str]):
    assert refusal(["--module", "tasks", *wrong])
