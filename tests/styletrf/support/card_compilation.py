"""A program: compiles every Triton kernel to machine code for a card, on a machine without one.

The interpreter runs kernels as Python; the compiler is stricter about types and shapes. Every
function of the backend is called with launches replaced by compilations, so that all outputs are 0.
Writes the names of the kernels.
"""

import os
import sys

os.environ["TRITON_INTERPRET"] = "0"

import torch
from kernel_cases import make_segments
from triton.backends.compiler import GPUTarget
from triton.runtime import driver
from triton.runtime.jit import JITFunction

from styletrf.field.kernels import March, kernels_for
from styletrf.field.tensor_vm import TensorVM

COMPILED = set()


class Card:
    """What Triton asks a driver before it compiles."""

    def __init__(self, capability: int) -> None:
        self.target = GPUTarget("cuda", capability, 32)

    def get_current_target(self) -> GPUTarget:
        return self.target

    def get_current_device(self) -> int:
        return 0

    def get_current_stream(self, _device: int) -> int:
        return 0


def compile_only(function, *args, grid, warmup, **options):
    kernel = launch(function, *args, grid=(1,), warmup=True, **options)
    assert kernel.asm["cubin"]
    COMPILED.add(function.__name__)


def call_all(backend, ranks):
    density = TensorVM((5, 1, 16), ranks)
    march = March(torch.ones(2, 3, 4, dtype=torch.uint8), 0.0, 1.0, 1e-3)
    segments = make_segments(4, seed=0)
    samples = backend.trace(density, segments, torch.rand(4), march)
    backend.density(density, samples.positions)
    colors = backend.composite(samples, backend.features(density, samples.positions))
    backend.prune(samples, 0.1)
    (colors.sum() + samples.weights.sum()).backward()


if __name__ == "__main__":
    launch, JITFunction.run = JITFunction.run, compile_only
    torch.empty, torch.empty_like = torch.zeros, torch.zeros_like
    torch.Tensor.new_empty = torch.Tensor.new_zeros
    driver.set_active(Card(int(sys.argv[1])))
    backend = kernels_for(torch.device("cuda"), "triton")
    for ranks in ((16, 4, 4), (1, 3, 5)):
        call_all(backend, ranks)
    sys.stdout.write(" ".join(sorted(COMPILED)))
