"""Real processes that are killed, or whose disk fails, wherever they are; and that wait.

A scenario is a situation and an act. `everywhere` interrupts the act once at each point it passes,
each time in a store of its own and in a process of its own; then looks the store over, lets the
act run to its end, and looks again. `killed` interrupts by SIGKILL at the named points (see
`Store.reached`), `faulted` by an error of the disk at the system calls that write.
"""

import contextlib
import errno
import gc
import itertools
import os
import select
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias, TypeVar

from pipeline.digest import tree_digest
from pipeline.maintenance.verify import problems
from pipeline.publication import publish
from pipeline.record import Action, ActionRecord
from pipeline.store import Store

WRITES = ("open", "write", "mkdir", "rename", "replace", "link", "symlink", "chmod", "fsync")
"""Calls that write or make way for it. (What only deletes does not need space.)"""


def nothing(_store: object) -> None:
    """Prepare nothing, and expect nothing."""


def nobody(_store: Store) -> contextlib.AbstractContextManager[object]:
    """No other process."""
    return contextlib.nullcontext()


@dataclass(frozen=True)
class Scenario:
    """Something that must survive being killed.

    Attributes:
        name: What the failing test shows.
        act: What is killed, and repeated afterwards.
        prepare: The situation before.
        always: What must hold after the kill, and after the repetition; asserts.
        expect: What must hold in the end; asserts.
        meanwhile: Who else is there all the time.
    """

    name: str
    act: Callable[[Store], object]
    prepare: Callable[[Store], object] = nothing
    always: Callable[[Store], object] = nothing
    expect: Callable[[Store], object] = nothing
    meanwhile: Callable[[Store], contextlib.AbstractContextManager[object]] = nobody


Act: TypeAlias = Callable[[Callable[[str], None]], object]
Point = TypeVar("Point", int, str)
"""A point that an act passes, by its number or its name."""


def everywhere(scenario: Scenario, folder: Path, interrupt: Callable[[Act, int], bool]) -> int:
    """Interrupt the act at each point it passes; returns the number of interruptions."""
    for number in range(1000):
        if not interrupted_at(number, scenario, folder, interrupt):
            return number
    raise AssertionError(f"{scenario.name} never ends")


def interrupted_at(
    point: Point, scenario: Scenario, folder: Path, interrupt: Callable[[Act, Point], bool]
) -> bool:
    """Interrupt the act at a point; False if it ended before."""
    store = Store.open(folder / f"{scenario.name}-{point}".replace(" ", "_"))
    run(lambda: scenario.prepare(Store(store.root)))
    before, where = wrong(store), f"{scenario.name}, interrupted at point {point}"
    with scenario.meanwhile(store):
        was_interrupted = interrupt(lambda hook: scenario.act(Store(store.root, hook)), point)
        assert wrong(store) <= before, where
        scenario.always(store)
        run(lambda: scenario.act(Store(store.root)))
        assert not list(problems(store, deep=True)), where
        scenario.always(store)
    scenario.expect(store)
    return was_interrupted


def make(
    store: Store, name: str, content: str = "", inputs: Sequence[ActionRecord] = (), files: int = 1
) -> ActionRecord:
    """Publish the artifact of an action named so, from what it is made of."""
    action = action_of(name, *(record.output.digest for record in inputs))
    with store.workspace(action.key) as workspace:
        (workspace / "out" / "deep").mkdir(parents=True)
        for number in range(files):
            (workspace / "out" / "deep" / f"{number}").write_text(content or name)
        provenance = {"label": name, "task": f"Toy(scene={name})", "started": f"{time.time():.6f}"}
        return publish(store, workspace / "out", action, provenance | {"seconds": 0.0, "log": ""})


def action_of(name: str, *inputs: str) -> Action:
    """What `make` makes."""
    named = {f"input{number}": digest for number, digest in enumerate(inputs)}
    return Action("Toy", "c" * 64, {"name": name}, named, {}, {})


def holds(store: Store, *records: ActionRecord) -> bool:
    """Whether the artifacts are there, to the last byte; takes no lease."""
    there = [store.record(record.action.key) for record in records]
    return all(record is not None and is_whole(store, record) for record in there)


def is_whole(store: Store, record: ActionRecord) -> bool:
    """Whether the object is what the record says, byte by byte."""
    try:
        return tree_digest(store.object(record.output.digest)) == record.output
    except (OSError, ValueError):
        return False


def wrong(store: Store) -> set[Path]:
    """Records that are none, and recorded objects that are missing or altered."""
    found = set()
    for path in (store.root / "actions").glob("*/*.json"):
        record = store.record(path.stem)
        if record is None:
            found.add(path)
        elif not is_whole(store, record):
            found.add(store.object(record.output.digest))
    return found


def killed(act: Act, point: int | str) -> bool:
    """Run the act in a process that dies at a point, by number or name; False if it ended first."""
    passed = itertools.count()

    def reached(name: str) -> None:
        if point in (next(passed), name):
            os.kill(os.getpid(), signal.SIGKILL)

    status = ended(forked(lambda: act(reached)))
    assert status in (0, -signal.SIGKILL)
    return status != 0


def faulted(act: Act, call: int) -> bool:
    """Run the act on a disk that fails once, at a call by number; False if it made fewer calls."""
    calls = itertools.count()

    def failing(name: str) -> Callable[..., object]:
        real = getattr(os, name)

        def fail(*arguments: object, **options: object) -> object:
            if next(calls) == call:
                error = (errno.ENOSPC, errno.EIO)[call % 2]
                raise OSError(error, os.strerror(error))
            return real(*arguments, **options)

        return fail

    def on_a_bad_disk() -> None:
        for name in WRITES:
            setattr(os, name, failing(name))
        with contextlib.suppress(OSError):
            act(nothing)
        os._exit(3 if next(calls) > call else 0)

    status = ended(forked(on_a_bad_disk))
    assert status in (0, 3)
    return status == 3


def run(act: Callable[[], object]) -> None:
    """Run `act` to its end in a process of its own, so that no lease of ours remains."""
    assert ended(forked(act)) == 0


def forked(act: Callable[[], object]) -> int:
    """Start `act` in a process of its own; returns its id."""
    child = os.fork()
    if child:
        return child
    gc.freeze()  # garbage of other tests may wait for threads, which a fork does not have
    status = 1
    try:
        act()
        status = 0
    except BaseException:  # noqa: BLE001  a process has no caller
        traceback.print_exc(file=sys.__stderr__)
    finally:
        os._exit(status)


def ended(child: int) -> int:
    """Wait for a process; returns its exit status, or minus the signal that ended it."""
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


class Gate:
    """Something that one process waits for, and another opens."""

    def __init__(self) -> None:
        self._read, self._write = os.pipe()

    def open(self) -> None:
        """Let everybody through from now on."""
        os.write(self._write, b"x" * 100)

    def wait(self, seconds: float = 30) -> bool:
        """Go on when it is open; False if it did not open in time."""
        return bool(select.select([self._read], [], [], seconds)[0])


@contextlib.contextmanager
def living(act: Callable[[], object], at_the_end: Callable[[], object]) -> Iterator[int]:
    """A process that does `act`, lives through the body, and in the end does `at_the_end`."""
    ready, go = Gate(), Gate()

    def live() -> None:
        act()
        ready.open()
        assert go.wait()
        at_the_end()

    child = forked(live)
    assert ready.wait()
    yield child
    go.open()
    assert ended(child) == 0


@contextlib.contextmanager
def paused(act: Act, point: str) -> Iterator[int]:
    """A process that runs `act(reached)` and stands still at a point until the body is done."""
    there, go = Gate(), Gate()

    def reached(name: str) -> None:
        if name == point:
            there.open()
            assert go.wait()

    child = forked(lambda: act(reached))
    assert there.wait()
    yield child
    go.open()
    assert ended(child) == 0
