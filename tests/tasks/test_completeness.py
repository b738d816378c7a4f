"""`complete()` is a predicate: it starts no process, connects to nothing, and prints nothing."""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
PROGRAM = """
import atexit, json, sys, threading
from luigi.cmdline_parser import CmdlineParser
from luigi.task_register import Register
import tasks

FORBIDDEN = {"subprocess.Popen", "os.fork", "os.forkpty", "os.exec", "os.system", "socket.connect"}

asked = None

def refuse(event, arguments):
    if asked and event in FORBIDDEN:
        raise SystemExit(f"complete() of {asked} caused {event} {arguments}")

registered = []
atexit.register = lambda hook, *rest: registered.append(hook)
sys.addaudithook(refuse)
for words in json.loads(sys.argv[1]):
    Register.clear_instance_cache()
    with CmdlineParser.global_instance(words) as parser:
        task = parser.get_task_obj()
        hook, asked = sys.excepthook, words
        pending, seen = [task], set()
        while pending:
            task = pending.pop()
            assert not task.complete()
            if task.task_id not in seen:
                seen.add(task.task_id)
                pending += task.deps()
        asked = None
    assert sys.excepthook is hook is sys.__excepthook__, words
assert threading.active_count() == 1
assert not [hook for hook in registered if hook.__module__.split(".")[0] in ("pipeline", "tasks")]
"""


COMMANDS = [
    ["StylizedTrajectory", "--scene", "mini", "--style", "p"],
    ["StylizedTrajectory", "--scene", "mini", "--style", "p", "--plan"],
    ["StylizedTrajectory", "--scene", "mini", "--style", "p", "--budget", "5min"],
    ["Grid", "--scenes", '["mini"]', "--styles", '["p"]'],
    ["Grid", "--scenes", '["mini"]', "--styles", '["p"]', "--plan"],
    ["SceneReport", "--scene", "mini"],
    ["TradeOff", "--scene", "mini", "--style", "p"],
]


def test_no_stage_of_a_command_causes_anything_when_it_is_asked(photographs):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, json.dumps(COMMANDS)],
        cwd=ROOT,
        env={**os.environ, "STYLETRF_DATA": str(photographs), "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
