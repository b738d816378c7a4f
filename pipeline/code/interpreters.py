"""Other interpreters, which find the same modules as this one."""

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Mapping
from typing import Any


def interpreter_environment() -> dict[str, str]:
    """Returns the variables of an interpreter that finds the modules of this one."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


def interpreter_command(function: str) -> list[str]:
    """Returns the command of an interpreter that calls a function and exits with its result.

    Args:
        function: The function, as `module:name`. Its arguments are added to the command.
    """
    module, _, name = function.partition(":")
    code = f"import sys; from {module} import {name}; sys.exit({name}(*sys.argv[1:]))"
    return [sys.executable, "-P", "-c", code]


def json_of_last_line(output: str) -> Any:
    """Returns the JSON in the last line of an output; libraries may write lines before it.

    Raises:
        ValueError: The last line is not JSON, or there is none.
    """
    return json.loads(next(reversed(output.splitlines()), ""))


def json_from(
    function: str,
    *arguments: str,
    environment: Mapping[str, str] | None = None,
    stderr: int | None = None,
) -> Any:
    """Calls a function in another interpreter; returns the JSON that it writes.

    Args:
        function: The function, as `module:name`. It writes the JSON as the last line of standard
            output.
        arguments: The arguments of the function.
        environment: The variables of the interpreter; by default those of this one.
        stderr: The standard error, as of `subprocess.run`.

    Raises:
        subprocess.CalledProcessError: The function failed, or wrote no JSON.
    """
    done = subprocess.run(
        [*interpreter_command(function), *arguments],
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
        check=False,
        env=environment or interpreter_environment(),
    )
    with contextlib.suppress(ValueError):
        if not done.returncode:
            return json_of_last_line(done.stdout)
    error = subprocess.CalledProcessError(done.returncode, done.args)
    error.add_note(f"{done.stderr or ''}"[-2000:])
    raise error
