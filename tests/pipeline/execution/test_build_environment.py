"""The environment of builds: how threads wait, and how much freed memory a process keeps."""

import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
from source_names import modules_imported, syntax_of

from pipeline.execution import cpu_memory
from pipeline.execution.environment import (
    allocator_settings,
    build_settings,
    openmp_wait_settings,
    quota_settings,
)

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("name", ["GOMP_SPINCOUNT", "OMP_WAIT_POLICY"])
def test_how_threads_wait_is_what_the_user_says(name):
    assert openmp_wait_settings({name: "as the user likes"}) == {}


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="one core is no more than its quota")
@pytest.mark.parametrize("code", ["import torch as library", "import numba as library"])
def test_a_library_starts_as_many_threads_as_a_quota_has_cores(tmp_path, monkeypatch, code):
    """In a container with one core of many, it started a thread for each core of the host."""
    (tmp_path / "cpu.max").write_text("100000 100000")
    monkeypatch.setattr(cpu_memory, "_CGROUP", tmp_path)
    words = [sys.executable, "-c", f"{code}; print(library.get_num_threads())"]
    variables = environment_of_users()
    before, under_quota = (
        int(subprocess.check_output(words, env=variables | settings))
        for settings in ({}, quota_settings(variables))
    )
    assert before > under_quota == 1


def test_without_a_quota_libraries_decide_on_their_threads(tmp_path, monkeypatch):
    monkeypatch.setattr(cpu_memory, "_CGROUP", tmp_path)
    assert quota_settings({}) == {}


def test_under_a_quota_the_threads_are_what_the_user_says(tmp_path, monkeypatch):
    (tmp_path / "cpu.max").write_text("50000 100000")
    monkeypatch.setattr(cpu_memory, "_CGROUP", tmp_path)
    assert quota_settings({"OMP_NUM_THREADS": "7"}) == {}


@pytest.mark.parametrize("name", ["MALLOC_TRIM_THRESHOLD_", "GLIBC_TUNABLES"])
def test_how_memory_is_kept_is_what_the_user_says(name):
    assert allocator_settings({name: "as the user likes"}) == {}


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="needs glibc")
@pytest.mark.parametrize(
    ("variables", "first"),
    [(allocator_settings({}), ""), ({"PYTHONPATH": "benchmarks:."}, "import build_environment")],
    ids=["build", "benchmark"],
)
def test_memory_that_a_process_has_had_causes_no_page_faults(variables, first):
    """Each page of a gradient was faulted in again: a sixth of a fit."""
    again = subprocess.check_output(
        [sys.executable, "-c", first + _FAULTS_OF_A_SECOND_BLOCK],
        env=environment_of_users() | variables,
        cwd=ROOT,
    )
    assert int(again) < 1000


_FAULTS_OF_A_SECOND_BLOCK = """
import resource

def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

for _ in range(2):
    before = faults()
    block = b"1" * (48 << 20)
    del block
print(faults() - before)
"""


def environment_of_users() -> dict[str, str]:
    """The variables of this process without those that builds add, or leave to the user."""
    names = (*build_settings({}), *cpu_memory.THREADS, "OMP_WAIT_POLICY", "GLIBC_TUNABLES")
    return {name: value for name, value in os.environ.items() if name not in names}


def test_a_program_can_be_started_with_the_settings_of_builds():
    command = [sys.executable, "-m", "pipeline.execution.environment"]
    printed = subprocess.check_output(command, env=environment_of_users(), text=True)
    assert dict(line.split("=") for line in printed.split()) == build_settings({})


@pytest.mark.parametrize("name", ["field", "style", "stylization"])
def test_benchmark_that_computes_itself_has_the_settings_of_builds_before_it_loads_libraries(name):
    """They had to be set by hand before the command."""
    top = syntax_of(ROOT / "benchmarks" / f"{name}.py").body
    libraries = (m for m in modules_imported(top) if m.split(".")[0] not in sys.stdlib_module_names)
    assert next(libraries) == "build_environment"
