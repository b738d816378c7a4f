"""The CPU backend sums in the same order on any number of threads."""

from collections.abc import Iterator

import numba
import pytest
import torch
from kernel_cases import generator, make_segments

from styletrf.field.kernels import March, kernels_for
from styletrf.field.tensor_vm import TensorVM

FUSED = kernels_for(torch.device("cpu"), "fused")


@pytest.fixture(autouse=True)
def _threads_as_before() -> Iterator[None]:
    before = numba.get_num_threads()
    yield
    numba.set_num_threads(before)


def on_threads(compute):
    """What `compute` returns on one thread and on as many as there are."""
    results = []
    for n_threads in (1, numba.config.NUMBA_NUM_THREADS):
        numba.set_num_threads(n_threads)
        results.append(compute())
    return results


def assert_bit_identical(one, many):
    assert all(torch.equal(a, b) for a, b in zip(one, many, strict=True))


def test_scattered_gradients_are_the_same_on_any_number_of_threads():
    positions = torch.rand(5000, 3, generator=generator(1)) * 2 - 1

    def compute():
        factors = TensorVM((40, 30, 20), (4, 4, 4), generator=generator(0))
        FUSED.features(factors, positions).square().sum().backward()
        return [p.grad for p in factors.parameters()]

    assert_bit_identical(*on_threads(compute))


def test_a_march_its_sums_and_their_gradients():
    segments = make_segments(400, seed=0)
    march = March(torch.ones(3, 3, 3, dtype=torch.uint8), 0.0, 1.0, 1e-3)

    def compute():
        factors = TensorVM((40, 30, 20), (4, 4, 4), scale=0.5, generator=generator(0))
        samples = FUSED.trace(factors, segments, torch.full((400,), 0.5), march)
        opacity = FUSED.opacity(samples)
        opacity.square().sum().backward()
        heavy = FUSED.prune(samples, 0.01)
        values = [samples.weights.detach(), opacity.detach(), heavy.s]
        return [*values, *(p.grad for p in factors.parameters())]

    assert_bit_identical(*on_threads(compute))


def test_gradients_of_colors_are_the_same_on_any_number_of_threads():
    ray = torch.randint(0, 300, (5000,), generator=generator(0)).sort().values
    shapes = [(5000, 12), (300, 16), (16, 12), (3, 16), (3,)]

    def compute():
        g = generator(1)
        leaves = [torch.randn(shape, generator=g).requires_grad_() for shape in shapes]
        FUSED.decode(*leaves[:2], ray, *leaves[2:]).square().sum().backward()
        return [leaf.grad for leaf in leaves]

    assert_bit_identical(*on_threads(compute))
