"""Checks whether tasks are complete, and ends if a check causes anything else.

`python completeness_cases.py COMMANDS` in a process of its own, since a hook of audits stays.
It prints what it found as JSON.
"""

import atexit
import contextlib
import json
import logging
import os
import sys
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import luigi
from luigi.cmdline_parser import CmdlineParser
from luigi.task_register import Register

import tasks
from pipeline.errors import StoreError
from pipeline.maintenance.task_graph import upstream_first
from pipeline.publication import publish
from pipeline.settings import current_store
from pipeline.shared_store.remote import Remote

FORBIDDEN = {"subprocess.Popen", "os.fork", "os.forkpty", "os.exec", "os.system", "socket.connect"}
PROVENANCE = {"label": "", "task": "", "started": "", "seconds": 0.0, "log": ""}
checked = ""


def refuse(event: str, arguments: object) -> None:
    """Ends the process: `complete` would swallow an ordinary exception."""
    if checked and event in FORBIDDEN:
        raise SystemExit(f"complete() of {checked} caused {event} {arguments}")


def is_complete(task: luigi.Task) -> bool:
    global checked
    checked, hook = str(task), sys.excepthook
    found = bool(task.complete())
    assert sys.excepthook is hook is sys.__excepthook__, checked
    checked = ""
    return found


@contextlib.contextmanager
def stages_of(words: Sequence[str]) -> Iterator[list[Any]]:
    """Yields the tasks of a command, upstream first, as a new process meets them."""
    Register.clear_instance_cache()
    with CmdlineParser.global_instance(list(words)) as parser:
        yield list(upstream_first(parser.get_task_obj()))


def found_complete(words: Sequence[str]) -> list[bool]:
    with stages_of(words) as stages:
        return [is_complete(stage) for stage in stages]


def make(words: Sequence[str]) -> None:
    """Publishes something as the artifact of each stage."""
    store = current_store()
    with stages_of(words) as stages:
        for stage in stages:
            action = stage.action()
            with store.workspace(action.key) as workspace:
                (workspace / "out").mkdir()
                (workspace / "out" / "file").write_text(stage.task_family)
                publish(store, workspace / "out", action, PROVENANCE)


def kept(root: Path) -> dict[str, str]:
    """Returns the files of a store but for the leases."""
    files = (path for path in root.rglob("*") if path.is_file() and path.suffix != ".keys")
    return {str(path): path.read_bytes().hex() for path in files}


def let_the_shared_store_fail(calls: list[str]) -> None:
    def fail(_remote: Remote, name: str) -> None:
        calls.append(name)
        raise StoreError("the shared store does not answer") from ConnectionError()

    os.environ.update(STYLETRF_REMOTE="/shared", STYLETRF_PATIENCE="0")
    for method in ("read", "has"):
        setattr(Remote, method, fail)


def main(commands: Sequence[Sequence[str]]) -> None:
    registered: list[Any] = []
    atexit.register = lambda hook, *_: registered.append(hook)  # type: ignore[assignment]
    sys.addaudithook(refuse)
    logging.getLogger("pipeline").addHandler(logging.NullHandler())
    poses = ["CameraPoses", "--scene", "mini"]
    found: dict[str, Any] = {"nothing made": [found_complete(words) for words in commands]}
    make(poses)
    before = kept(current_store().root)
    found["made"] = found_complete(poses)
    found["leaves"] = sorted(kept(current_store().root).items() ^ before.items())
    calls: list[str] = []
    let_the_shared_store_fail(calls)
    found["made, remote fails"] = found_complete(poses), len(calls)
    found["missing, remote fails"] = found_complete(["SceneModel", "--scene", "mini"]), len(calls)
    found["threads"] = threading.active_count()
    own = ("pipeline", "tasks")
    found["hooks"] = [str(h) for h in registered if h.__module__.split(".")[0] in own]
    sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    assert tasks.__all__
    main(json.loads(sys.argv[1]))
