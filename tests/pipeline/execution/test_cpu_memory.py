"""A share of the host for each build, over real commands; the folder of leases is a setting."""

import json
import os
import time
from pathlib import Path

import luigi
import pytest
from build_toys import OnCores
from commands import start
from forked_modules import ForkedModule
from message_words import mentions

from pipeline.errors import StoreError
from pipeline.execution import cpu_memory
from pipeline.execution.host_locks import open_locks, release, try_acquire
from pipeline.execution.resources import cpu_for
from pipeline.task import artifact

CORES = sorted(os.sched_getaffinity(0))


HALF = -(-len(CORES) // 2)


N_PARTS = -(-64 * HALF // len(CORES))


needs_two_cores = pytest.mark.skipif(len(CORES) < 2, reason="needs two cores")


@pytest.fixture(autouse=True)
def leases(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of leases of the test's own, here and in the commands it starts."""
    monkeypatch.setenv("STYLETRF_LEASES", str(tmp_path / "leases"))
    return tmp_path / "leases"


def built_on_cores(workers: int, names: list[str]) -> list[dict]:
    command = begin_on_cores(workers, names)
    screen = "".join(command.communicate(timeout=60))
    assert command.returncode == 0, screen
    return [cores_of(name) for name in names]


def begin_on_cores(workers: int, names: list[str]) -> ForkedModule:
    words = ["ManyOnCores", "--names", json.dumps(names), "--workers", str(workers)]
    return start("luigi", "--module", "toys", *words)


def cores_of(name: str) -> dict:
    return json.loads((artifact(OnCores(name)) / "cores.json").read_text())


def most_at_once(built: list[dict]) -> int:
    return max(sum(a["began"] <= b["began"] < a["ended"] for a in built) for b in built)


@needs_two_cores
def test_builds_that_run_at_once_share_no_core():
    built = built_on_cores(len(CORES), [f"{k}" for k in range(2 * len(CORES))])
    assert all(len(b["cores"]) == 1 and b["threads"] == "1" for b in built)
    for a in built:
        beside = [
            b for b in built if b is not a and a["began"] < b["ended"] and b["began"] < a["ended"]
        ]
        assert all(not set(a["cores"]) & set(b["cores"]) for b in beside)
    assert most_at_once(built) > 1


def test_more_workers_than_cores_do_not_run_at_once():
    built = built_on_cores(2 * len(CORES) + 1, [f"{k}" for k in range(2 * len(CORES) + 1)])
    assert most_at_once(built) <= len(CORES)


def test_a_lone_build_has_the_host_to_itself():
    (built,) = built_on_cores(1, ["one"])
    assert built["cores"] == CORES
    assert built["threads"] == os.environ.get("OMP_NUM_THREADS")


@needs_two_cores
def test_a_command_beside_another_gets_the_other_half_and_says_so(leases):
    """A command alone used all cores and planned all memory, and so did a second one."""
    with cpu_memory.allocate_alone(HALF, None, print) as first:
        assert first.cores == len(CORES), "the first did not expect another"
        assert not first.cpu_affinity
        second = begin_on_cores(1, ["beside"])
        screen = "".join(second.communicate(timeout=60))
        built = cores_of("beside")
        assert built["cores"] == CORES[HALF:]
        assert built["threads"] == str(len(CORES) - HALF)
        assert mentions(screen, f"uses {len(CORES) - HALF} of {len(CORES)} cores")
    assert built_on_cores(1, ["after"])[0]["cores"] == CORES


def test_where_no_core_is_free_a_lone_build_uses_all_and_does_not_wait(leases):
    with (
        cpu_memory.allocate(len(CORES), 0, print),
        cpu_memory.allocate_alone(HALF, None, pytest.fail) as fraction,
    ):
        assert (fraction.cores, fraction.cpu_affinity) == (len(CORES), ())


def test_a_lone_build_waits_for_memory_that_it_is_known_to_need(leases):
    waits = []

    def say(what: str) -> None:
        waits.append(what)
        raise InterruptedError

    with cpu_memory.allocate_alone(HALF, 2**60, print):
        with cpu_memory.allocate_alone(HALF, None, say):
            pass
        assert not waits, "nothing is known of its memory"
        with pytest.raises(InterruptedError), cpu_memory.allocate_alone(HALF, 2**60, say):
            pass
    assert mentions(waits[0], "GiB")


def test_a_process_with_some_of_the_cores_takes_as_much_of_the_memory(
    leases, tmp_path, monkeypatch
):
    """A node's scheduler binds a build to its cores; the memory that is read is all builds'."""
    monkeypatch.setattr(cpu_memory, "_CGROUP", tmp_path)
    monkeypatch.setattr(os, "cpu_count", lambda: 8 * len(CORES))
    with cpu_memory.allocate(len(CORES), None, print) as fraction:
        assert len(fraction.inherited_fds) == 64 // 8 + len(CORES)
    (tmp_path / "memory.max").write_text("1073741824")
    with cpu_memory.allocate(len(CORES), None, print) as fraction:
        assert len(fraction.inherited_fds) == 64 + len(CORES), "what is its own it may take"


def test_what_needs_all_the_memory_waits_for_what_has_some(leases, capsys, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: len(CORES))
    with cpu_memory.allocate(HALF, None, print) as first:
        assert len(first.inherited_fds) == N_PARTS + first.cores, "a part where nothing is known"
        with open_locks("memory", [str(n) for n in range(64)]) as files:
            assert len(try_acquire(files, 1, 64)) == 64 - N_PARTS
    with (
        cpu_memory.allocate(HALF, 2**60, print) as greedy,
        open_locks("memory", ["0", "63"]) as files,
    ):
        assert try_acquire(files, 1, 2) == [], "more than there is means all there is"
        assert greedy.cores >= 1
    assert not capsys.readouterr().out


def test_a_build_that_waits_says_for_what(leases):
    said = []

    class GivenUpError(Exception):
        pass

    def say(what: str) -> None:
        said.append(what)
        raise GivenUpError

    with open_locks("core", [str(core) for core in CORES]) as files:
        assert len(try_acquire(files, len(CORES), len(CORES))) == len(CORES)
        with pytest.raises(GivenUpError), cpu_memory.allocate(HALF, 0, say):
            pass
    with open_locks("memory", ["0"]) as files:
        try_acquire(files, 1, 1)
        with pytest.raises(GivenUpError), cpu_memory.allocate(HALF, 2**60, say):
            pass
    assert mentions(said[0], "core")
    assert mentions(said[1], "GiB")


@needs_two_cores
@pytest.mark.parametrize("surplus", [0, 1])
def test_a_build_waits_for_the_cores_that_the_user_sets(leases, monkeypatch, surplus):
    """A build beside another got fewer, without a line."""
    monkeypatch.setenv("STYLETRF_CORES", str(len(CORES) + surplus))
    waits = []
    with open_locks("core", [str(core) for core in CORES]) as files:
        assert len(try_acquire(files, 1, 1)) == 1
        monkeypatch.setattr(time, "sleep", lambda _: release(files, files) or waits.append(1))
        with cpu_for("toy", None) as allocation:
            assert (waits, allocation.cores) == ([1], len(CORES))


def test_all_or_nothing_is_taken(leases):
    with open_locks("part", ["a", "b", "c"]) as mine, open_locks("part", ["a", "b", "c"]) as others:
        assert try_acquire(others, 1, 1) == ["a"]
        assert try_acquire(mine, 3, 3) == []
        assert try_acquire(others, 3, 3) == ["a", "b", "c"], "what was not enough was given back"


@pytest.mark.parametrize(
    ("files", "cores"),
    [
        ({}, len(CORES)),
        ({"cpu.max": "max 100000"}, len(CORES)),
        ({"cpu.max": "50000 100000"}, 1),
        ({"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"}, len(CORES)),
        ({"cpu/cpu.cfs_quota_us": "100000", "cpu/cpu.cfs_period_us": "100000"}, 1),
        ({"cpu.max": "garbage"}, len(CORES)),
    ],
)
def test_a_quota_of_the_container_counts(tmp_path, monkeypatch, files, cores):
    for name, text in files.items():
        (tmp_path / "group" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "group" / name).write_text(text)
    monkeypatch.setattr(cpu_memory, "_CGROUP", tmp_path / "group")
    assert len(cpu_memory.usable_cores()) == cores
    with cpu_memory.allocate(HALF, 0, print) as fraction:
        assert bool(fraction.cpu_affinity) == (cores == len(CORES)), (
            "under a quota cores have no numbers"
        )


def test_the_memory_of_the_container_counts(tmp_path, monkeypatch):
    monkeypatch.setattr(cpu_memory, "_CGROUP", tmp_path)
    (tmp_path / "memory.max").write_text("1073741824")
    assert cpu_memory.memory_bytes() == int(0.9 * 2**30)
    (tmp_path / "memory.max").write_text("max")
    assert cpu_memory.memory_bytes() > 2**30
    here = luigi.configuration.get_config()
    here.set("host", "memory_gib", "3")
    assert cpu_memory.memory_bytes() == 3 * 2**30
    here.remove_option("host", "memory_gib")


def test_a_lone_build_has_the_whole_host_where_no_folder_of_leases_can_be_used(
    tmp_path, monkeypatch, caplog
):
    monkeypatch.setenv("STYLETRF_LEASES", str(tmp_path / "missing" / "leases"))
    with cpu_memory.allocate_alone(1, None, lambda _: None) as fraction:
        assert fraction.cores == len(cpu_memory.usable_cores())
    assert mentions(caplog.text, "missing")


@pytest.mark.parametrize("word", ["four", "2.0", "-1"])
def test_a_number_of_cores_that_is_none_is_an_error_with_its_variable(monkeypatch, word):
    """A negative one waited for ever, and all commands of the host with it."""
    monkeypatch.setenv("STYLETRF_CORES", word)
    with pytest.raises(StoreError) as error, cpu_for("a build", None):
        pass
    assert mentions(str(error.value), f"STYLETRF_CORES = {word}")
