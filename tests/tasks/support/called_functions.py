"""The functions of the project that Python calls while a stage builds."""

import gc
import inspect
import json
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import CodeType, FrameType

ROOT = Path(__file__).parents[3]


def functions_called_for(artifact: Path) -> list[str]:
    """Returns the functions that a build on the mini scene called, as `module:name`."""
    return json.loads(_file(artifact).read_text())


def keep_functions(artifact: Path, names: set[str]) -> None:
    """Writes the names beside the artifact."""
    _file(artifact).write_text(json.dumps(sorted(names)))


@contextmanager
def functions_called() -> Iterator[set[str]]:
    """Yields a set that receives the functions which the body calls, in any thread."""
    root, found = f"{ROOT}/", set()
    ours = (f"{root}styletrf/", f"{root}tasks/")
    seen: dict[int, CodeType] = {}  # most calls are of what was called before

    def note(frame: FrameType, event: str, _value: object) -> None:
        if event != "call" or id(code := frame.f_code) in seen:
            return
        seen[id(code)] = code
        is_function = code.co_flags & inspect.CO_OPTIMIZED  # and no module's or class's body
        if is_function and code.co_filename.startswith(ours):
            module = code.co_filename.removeprefix(root).removesuffix(".py").replace("/", ".")
            found.add(f"{module.removesuffix('.__init__')}:{code.co_qualname}")

    gc.disable()  # it may close a generator left over from another build, which is a call
    threading.setprofile(note)
    sys.setprofile(note)
    try:
        yield found
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
        gc.enable()


def _file(artifact: Path) -> Path:
    return artifact.with_name("functions.json")
