"""`complete()` is a predicate: it starts no process, connects to nothing, and prints nothing."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
PROGRAM = Path(__file__).with_name("support") / "completeness_cases.py"
COMMANDS = [
    ["StylizedTrajectory", "--scene", "mini", "--style", "p"],
    ["StylizedTrajectory", "--scene", "mini", "--style", "p", "--plan"],
    ["StylizedTrajectory", "--scene", "mini", "--style", "p", "--budget", "5min"],
    ["Grid", "--scenes", '["mini"]', "--styles", '["p"]'],
    ["Grid", "--scenes", '["mini"]', "--styles", '["p"]', "--plan"],
    ["SceneReport", "--scene", "mini"],
    ["TradeOff", "--scene", "mini", "--style", "p"],
]


@pytest.fixture(scope="module")
def found(photographs: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a process found that ends as soon as `complete()` starts, forks or connects."""
    store = tmp_path_factory.mktemp("completeness") / "store"
    done = subprocess.run(
        [sys.executable, str(PROGRAM), json.dumps(COMMANDS)],
        cwd=ROOT,
        env={
            **{name: text for name, text in os.environ.items() if name != "STYLETRF_REMOTE"},
            "STYLETRF_DATA": str(photographs),
            "STYLETRF_STORE": str(store),
            "PYTHONPATH": str(ROOT),
        },
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return dict(json.loads(done.stdout))


def test_no_stage_of_a_command_causes_anything_when_it_is_asked(found):
    assert [any(stages) for stages in found["nothing made"]] == [False] * len(COMMANDS)
    assert all(found["nothing made"])
    assert (found["threads"], found["hooks"]) == (1, [])


def test_a_stage_that_is_made_is_complete_and_the_check_leaves_a_lease_alone(found):
    assert found["made"]
    assert all(found["made"])
    assert found["leaves"] == []


def test_a_stage_that_is_made_is_complete_without_a_look_into_the_shared_store(found):
    assert found["made, remote fails"] == [found["made"], 0]


def test_a_stage_that_is_not_here_is_incomplete_where_the_shared_store_fails(found):
    """One failure suspends all reading for a while."""
    stages, calls = found["missing, remote fails"]
    assert stages == [*found["made"], False]
    assert calls == 1
