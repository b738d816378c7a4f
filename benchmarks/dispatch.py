"""What dispatch by a custom operator of torch costs: `python benchmarks/dispatch.py`.

Prints microseconds of an operator of a field's seven tensors that computes next to nothing: as a
`torch.autograd.Function`, as the kernels are, and as a `torch.library.custom_op`; forward alone,
and forward and backward. Of thirty rounds the fastest counts, which other work disturbed least.
"""

import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import torch
from torch import Tensor

_ROUNDS, _CALLS = 30, 300


class Function(torch.autograd.Function):
    """As a function of autograd."""

    @staticmethod
    def forward(ctx: Any, positions: Tensor, *factors: Tensor) -> Tensor:
        """Keeps the factors."""
        ctx.save_for_backward(*factors)
        return positions.new_zeros(4, 8)

    @staticmethod
    def backward(ctx: Any, *_grads: Tensor) -> tuple[Tensor | None, ...]:
        """Returns gradients of zeros."""
        return None, *(torch.zeros_like(each) for each in ctx.saved_tensors)


@torch.library.custom_op("styletrf_benchmark::operator", mutates_args=())
def operator(positions: Tensor, factors: Sequence[Tensor]) -> Tensor:  # noqa: ARG001
    """As a custom operator."""
    return positions.new_zeros(4, 8)


def _keep(ctx: Any, inputs: tuple[Tensor, Sequence[Tensor]], output: Tensor) -> None:  # noqa: ARG001
    ctx.save_for_backward(*inputs[1])


def _zeros(ctx: Any, _grad: Tensor) -> tuple[None, list[Tensor]]:
    return None, [torch.zeros_like(each) for each in ctx.saved_tensors]


operator.register_autograd(_zeros, setup_context=_keep)


def microseconds(call: Callable[[], object]) -> float:
    """Returns the time of a call, of the fastest round."""
    call()
    rounds = []
    for _ in range(_ROUNDS):
        started = time.perf_counter()
        for _ in range(_CALLS):
            call()
        rounds.append((time.perf_counter() - started) / _CALLS)
    return 1e6 * min(rounds)


def _both(form: Callable[[], Tensor]) -> None:
    form().sum().backward()


def main() -> None:
    """Prints a line for each form."""
    positions = torch.zeros(4, 3)
    factors = [torch.zeros(2, 2, 2, requires_grad=True) for _ in range(6)]
    forms: dict[str, Callable[[], Tensor]] = {
        "autograd.Function": lambda: Function.apply(positions, *factors),  # type: ignore[no-untyped-call]
        "custom_op": lambda: operator(positions, factors),
    }
    for name, form in forms.items():
        with torch.no_grad():
            forward = microseconds(form)
        both = microseconds(partial(_both, form))
        sys.stdout.write(f"{name}: forward {forward:.1f} us, forward and backward {both:.1f} us\n")


if __name__ == "__main__":
    main()
