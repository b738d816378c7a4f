"""`python -m` in another folder, forked from an interpreter that has what Luigi imports."""

import os
import runpy
import sys
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from pathlib import Path
from tempfile import TemporaryFile

from pipeline.execution.fork_server import current_fork_server, fork_server

ROOT = Path(__file__).parents[3]


@contextmanager
def libraries_imported() -> Iterator[None]:
    """The body's commands are forked. Luigi reads settings on import, so each imports it itself."""
    with fork_server(["asyncio", "dateutil.parser", "jsonschema", "requests", "tenacity"]):
        yield


def output_of(folder: Path, *arguments: str) -> tuple[int, str]:
    """Exit status and screen of `python -m` in a folder, whose modules it can import."""
    with TemporaryFile("w+") as out, TemporaryFile("w+") as err, Path(os.devnull).open() as nothing:
        streams = nothing.fileno(), out.fileno(), err.fileno()
        with chdir(folder):  # Luigi reads the settings there when it is imported
            process = current_fork_server().start(
                "forked_modules:run", arguments, os.environ, streams
            )
        status = process.wait()
        out.seek(0)
        err.seek(0)
        return status, out.read() + err.read()


def run(module: str, *arguments: str) -> None:
    """In the process that was forked: becomes the command."""
    sys.path[:0] = [str(Path.cwd()), str(ROOT)]
    sys.argv[1:] = arguments
    runpy.run_module(module, run_name="__main__", alter_sys=True)
