"""Commands in processes of their own, and the processes that they leave."""

import functools
import io
import os
import subprocess
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import psutil
from forked_modules import ForkedModule

from pipeline.execution.fork_server import ForkServer
from pipeline.maintenance.command_line import main

SUPPORT = Path(__file__).parent
ROOT = SUPPORT.parents[2]


@functools.cache
def command_server() -> ForkServer:
    """What forks the commands, until `close_server`."""
    return ForkServer(["asyncio", "dateutil.parser", "jsonschema", "requests", "tenacity", "tqdm"])


def close_server() -> None:
    command_server().close()
    command_server.cache_clear()


def start(*arguments: str, cwd: Path = ROOT, stderr: int = subprocess.PIPE) -> ForkedModule:
    """`python -m` with these words, forked by `command_server`."""
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(ROOT), str(SUPPORT)]),
    }
    return ForkedModule(command_server(), arguments, cwd=cwd, env=environment, stderr=stderr)


def luigi(*arguments: str, cwd: Path = ROOT) -> tuple[int, str]:
    """Exit status and screen of `luigi --module toys ...`."""
    return finish(start("luigi", "--module", "toys", *arguments, cwd=cwd))


def finish(process: ForkedModule) -> tuple[int, str]:
    """Exit status and screen of a process, when it has ended."""
    screen = "".join(process.communicate(timeout=60))
    return process.returncode, screen


def pipeline(*arguments: str) -> tuple[int, str]:
    """Exit status and screen of `python -m pipeline ...`, which runs in this process."""
    with io.StringIO() as screen, redirect_stdout(screen), redirect_stderr(screen):
        return main([*arguments]), screen.getvalue()


def pids_of_slow(toys: Path) -> list[int]:
    """The builder and its child, once they run."""
    deadline = time.monotonic() + 30
    while not (toys / "pids.txt").exists():
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return [int(pid) for pid in (toys / "pids.txt").read_text().split()]


def are_gone(pids: list[int]) -> bool:
    deadline = time.monotonic() + 10
    while any(is_running(pid) for pid in pids):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


def is_running(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False
