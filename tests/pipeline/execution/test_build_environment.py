"""The environment of builds: how threads wait, and how much freed memory a process keeps."""

import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
from source_names import modules_imported, syntax_of

from pipeline.execution.environment import (
    allocator_settings,
    build_settings,
    openmp_wait_settings,
)

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("name", ["GOMP_SPINCOUNT", "OMP_WAIT_POLICY"])
def test_how_threads_wait_is_what_the_user_says(name):
    assert openmp_wait_settings({name: "as the user likes"}) == {}


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
    names = (*build_settings({}), "OMP_WAIT_POLICY", "GLIBC_TUNABLES")
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
