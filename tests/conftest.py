"""What every test runs in: a store of its own, and nothing left in Luigi from the test before."""

import gc
import itertools
import os
import signal
import sys
from collections.abc import Generator, Iterator
from typing import Any

import pytest
from hypothesis import settings

from pipeline.execution.environment import SPIN_COUNT

# Before torch is imported: workers of pytest-xdist take each other's cores, also from the builds of
# tests that are too short to adjust their threads.
if "OMP_WAIT_POLICY" not in os.environ:
    os.environ.setdefault(SPIN_COUNT, "1000")
# Workers inherit it: a thread of OpenBLAS spins while it waits for others, and these have no core.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

pytest_plugins = ["durations", "stability"]

# A run on the same code draws the same examples: what fails, fails again.
# How long an example takes depends on what else the machine does.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")


_stores = itertools.count()


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What is imported and collected stays, so the garbage collector need not go through it."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture(autouse=True, scope="session")
def _shared(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Workers share what takes seconds to make."""
    from shared_results import share_in

    own = tmp_path_factory.getbasetemp()
    share_in(own.parent if hasattr(request.config, "workerinput") else own)


@pytest.fixture(autouse=True, scope="session")
def _leases(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Commands of tests share the host with each other, and not with those of other workers."""
    os.environ["STYLETRF_LEASES"] = str(tmp_path_factory.getbasetemp() / "leases")


@pytest.fixture(autouse=True, scope="module")
def _interruptible() -> Iterator[None]:
    """A background shell makes the tests, and what they start, deaf to SIGINT."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(autouse=True, scope="module")
def _one_thread() -> None:
    """Workers of pytest-xdist share the cores, so each of them computes on one thread."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        _compute_on(1)


@pytest.fixture
def all_cores() -> Iterator[None]:
    """The test computes on as many threads as there are cores."""
    _compute_on(len(os.sched_getaffinity(0)))
    yield
    if "PYTEST_XDIST_WORKER" in os.environ:
        _compute_on(1)


@pytest.fixture(autouse=True)
def _repeatable() -> None:
    """torch's global generator starts each test at the same seed."""
    if torch := sys.modules.get("torch"):
        torch.manual_seed(0)


@pytest.fixture(autouse=True)
def _isolated(
    request: pytest.FixtureRequest,
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
) -> Iterator[None]:
    """A store of its own; Luigi's register and instances as they were before the test."""
    if "tmp_path" in request.fixturenames:
        store = request.getfixturevalue("tmp_path") / "store"
    else:  # most tests need no folder, which takes longer to make than they do
        store = tmp_path_factory.getbasetemp() / f"store-{next(_stores)}"
    monkeypatch.setenv("STYLETRF_STORE", str(store))
    monkeypatch.delenv("STYLETRF_REMOTE", raising=False)
    known = list(register._reg) if (register := _register()) else None
    yield
    if register := _register():
        register.clear_instance_cache()
        if known is not None:
            register._reg[:] = known


@pytest.fixture
def inline() -> Iterator[None]:
    """Builds run in the test's own process."""
    import luigi

    config = luigi.configuration.get_config()
    before = config.get("store", "executor", "subprocess")
    config.set("store", "executor", "inline")
    yield
    config.set("store", "executor", before)


def _compute_on(threads: int) -> None:
    """Sets how many threads torch and numba use, where the tests have loaded them."""
    if torch := sys.modules.get("torch"):
        torch.set_num_threads(threads)
    if numba := sys.modules.get("numba"):
        numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))


def _register() -> Any:
    """Luigi's register of task classes, if the test has loaded Luigi at all."""
    module = sys.modules.get("luigi.task_register")
    return module.Register if module else None
