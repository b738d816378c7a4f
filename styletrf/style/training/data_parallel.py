"""Training by several processes, a GPU each, or several threads, a core each.

Each computes a shard of the batch, and all take the same step. The gradient is the mean over the
shards. A loss that is no mean over images, such as the relative ones, is thereby the mean of the
shards' losses, which is not quite that of the whole batch.
"""

import contextlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import torch
from jaxtyping import Shaped
from torch import Tensor, distributed

Part = TypeVar("Part")
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Ranks:
    """The number of this process among how many; alone, it has the whole batch."""

    rank: int = 0
    count: int = 1

    @property
    def is_first(self) -> bool:
        """Whether it is the one that reports and writes."""
        return self.rank == 0

    def shard(self, batch: Shaped[Tensor, "batch ..."]) -> Shaped[Tensor, "shard ..."]:
        """Returns this process's part of a batch.

        Raises:
            ValueError: The batch cannot be divided evenly.
        """
        if len(batch) % self.count:
            raise ValueError(f"{len(batch)} images cannot be divided among {self.count}")
        return batch.chunk(self.count)[self.rank]

    def average(self, tensors: Iterable[Tensor | None]) -> None:
        """Replaces each tensor by its mean over all processes, in place."""
        if self.count == 1:
            return
        for tensor in tensors:
            if tensor is not None:
                distributed.all_reduce(tensor)
                tensor.div_(self.count)


def joined(device: torch.device) -> Ranks:
    """Returns the place of this process among those that `torchrun` started together."""
    if not distributed.is_torchelastic_launched():
        return Ranks()
    distributed.init_process_group("nccl" if device.type == "cuda" else "gloo")
    return Ranks(distributed.get_rank(), distributed.get_world_size())


def map_on_cores(compute: Callable[[Part], Result], parts: Sequence[Part]) -> list[Result]:
    """Returns the results of all parts, in their order, computed at once on parts of the cores.

    A small network's layers are too small for several threads, which only wait for each other; a
    thread with an image of its own never waits.
    """
    if len(parts) == 1:
        return [compute(parts[0])]
    cores = torch.get_num_threads()
    workers = min(len(parts), cores)
    with _threads_each(cores // workers), ThreadPoolExecutor(workers) as pool:
        return list(pool.map(compute, parts))


@contextlib.contextmanager
def _threads_each(count: int) -> Iterator[None]:
    """Gives each thread that computes `count` threads of torch."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
