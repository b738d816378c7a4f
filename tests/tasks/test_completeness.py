"""`complete()` is a predicate: it starts no process, connects to nothing, and prints nothing."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROGRAM = """
import atexit, sys, threading
from luigi.cmdline_parser import CmdlineParser
import tasks

FORBIDDEN = {"subprocess.Popen", "os.fork", "os.forkpty", "os.exec", "os.system", "socket.connect"}

def refuse(event, arguments):
    if event in FORBIDDEN:
        raise SystemExit(f"complete() caused {event} {arguments}")

registered = []
atexit.register = lambda hook, *rest: registered.append(hook)
with CmdlineParser.global_instance(sys.argv[1:]) as parser:
    task = parser.get_task_obj()
    hook = sys.excepthook
    sys.addaudithook(refuse)
    pending, seen = [task], set()
    while pending:
        task = pending.pop()
        assert not task.complete()
        if task.task_id not in seen:
            seen.add(task.task_id)
            pending += task.deps()
assert sys.excepthook is hook is sys.__excepthook__
assert threading.active_count() == 1
assert not [hook for hook in registered if hook.__module__.split(".")[0] in ("pipeline", "tasks")]
"""


@pytest.mark.parametrize(
    "words",
    [
        ["StylizedTrajectory", "--scene", "mini", "--style", "p"],
        ["StylizedTrajectory", "--scene", "mini", "--style", "p", "--plan"],
        ["StylizedTrajectory", "--scene", "mini", "--style", "p", "--budget", "5min"],
        ["Grid", "--scenes", '["mini"]', "--styles", '["p"]'],
        ["Grid", "--scenes", '["mini"]', "--styles", '["p"]', "--plan"],
        ["SceneReport", "--scene", "mini"],
        ["TradeOff", "--scene", "mini", "--style", "p"],
    ],
)
def test_no_stage_of_a_command_causes_anything_when_it_is_asked(photographs, words):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *words],
        cwd=ROOT,
        env={**os.environ, "STYLETRF_DATA": str(photographs), "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
