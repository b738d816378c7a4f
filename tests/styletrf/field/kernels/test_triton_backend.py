"""Which backend is chosen where, and that the Triton backend compiles for cards."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from expected_errors import rejects

from styletrf.field import kernels
from styletrf.field.kernels import BACKENDS, kernels_for

CPU, CUDA = torch.device("cpu"), torch.device("cuda")
ROOT = Path(__file__).parents[4]
SUPPORT = ROOT / "tests/styletrf/support"
KERNELS = {
    "_composite", "_composite_gradients", "_count", "_density", "_features", "_heavy", "_march",
    "_pack", "_raw_gradients", "_scatter_pair",
}  # fmt: skip


def test_the_fastest_backend_is_chosen_and_can_be_overridden():
    assert kernels_for(CPU).name == "fused"
    assert kernels_for(torch.device("meta")).name == "reference"
    for name in ("reference", "fused"):
        assert kernels_for(CPU, name).name == kernels_for(CUDA, name).name == name


def test_triton_is_chosen_on_a_gpu_where_it_is_installed():
    pytest.importorskip("triton", reason="Triton is not installed (extra gpu)")
    assert kernels_for(CUDA).name == "triton"
    assert kernels_for(CPU, "triton").name == "triton"


def test_without_triton_a_gpu_has_the_reference(monkeypatch):
    monkeypatch.setattr(kernels, "find_spec", lambda name: None)
    assert kernels_for(CUDA).name == "reference"
    with rejects("kernels triton", "triton"):
        kernels_for(CUDA, "triton")


def test_an_unknown_form_is_refused_with_those_there_are():
    with rejects("kernels fastest") as refusal:
        kernels_for(CPU, "fastest")
    assert ", ".join(BACKENDS) in refusal.value.remedy


def run(*command: str | Path, **environment: str) -> str:
    path = os.pathsep.join([str(SUPPORT), str(ROOT), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, *command],
        env={**os.environ, "PYTHONPATH": path, **environment},
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    ).stdout


def test_choosing_another_backend_does_not_import_triton():
    program = (
        "import sys, torch; from styletrf.field.kernels import kernels_for;"
        "kernels_for(torch.device('cpu')); kernels_for(torch.device('cuda'), 'reference');"
        "print('styletrf.field.kernels.triton_backend' in sys.modules)"
    )
    assert run("-c", program).strip() == "False"


@pytest.mark.slow
@pytest.mark.parametrize("capability", ["80", "90"])
def test_every_kernel_compiles_for_a_card(capability, tmp_path):
    """For Ampere and Hopper: the interpreter forgives what the compiler does not."""
    pytest.importorskip("triton", reason="Triton is not installed (extra gpu)")
    compiled = run(SUPPORT / "card_compilation.py", capability, TRITON_CACHE_DIR=str(tmp_path))
    assert set(compiled.split()) == KERNELS
