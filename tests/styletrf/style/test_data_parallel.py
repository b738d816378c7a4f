"""Several processes that share each batch."""

import os
import socket

import pytest
import torch
from torch import distributed, multiprocessing

from styletrf.style.training.data_parallel import Ranks, map_on_cores


def test_a_process_alone_has_the_whole_batch_and_its_own_gradient():
    batch = torch.arange(6.0).reshape(3, 2)
    assert torch.equal(Ranks().shard(batch), batch)
    gradient = torch.ones(2)
    Ranks().average([gradient, None])
    assert torch.equal(gradient, torch.ones(2))


@pytest.mark.parametrize("count", [1, 2, 3, 6])
def test_equal_shares_of_all_processes_are_the_batch(count):
    batch = torch.arange(6)
    shards = [Ranks(rank, count).shard(batch) for rank in range(count)]
    assert torch.equal(torch.cat(shards), batch)
    assert {len(shard) for shard in shards} == {6 // count}


def test_a_batch_that_cannot_be_divided_is_refused():
    with pytest.raises(ValueError, match=r"\b5\b.*\b2\b"):
        Ranks(0, 2).shard(torch.arange(5))


def _step(rank: int, port: int, results) -> None:
    """A gradient of a linear loss on a share of the batch, averaged."""
    os.environ.update(MASTER_ADDR="127.0.0.1", MASTER_PORT=str(port))
    distributed.init_process_group("gloo", rank=rank, world_size=2)
    weight = torch.ones(3, requires_grad=True)
    shard = Ranks(rank, 2).shard(torch.arange(12.0).reshape(4, 3))
    (shard @ weight).square().mean().backward()
    Ranks(rank, 2).average([weight.grad, None])
    results.put((rank, weight.grad.tolist()))
    distributed.destroy_process_group()


def test_the_mean_of_the_shares_gradients_is_that_of_the_batch():
    weight = torch.ones(3, requires_grad=True)
    (torch.arange(12.0).reshape(4, 3) @ weight).square().mean().backward()
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["torch", "styletrf.style.training.data_parallel"])
    results = context.SimpleQueue()
    processes = [context.Process(target=_step, args=(rank, port, results)) for rank in range(2)]
    for process in processes:
        process.start()
    found = dict(results.get() for _ in processes)
    for process in processes:
        process.join(60)
    assert found[0] == found[1] == pytest.approx(weight.grad.tolist())


@pytest.mark.usefixtures("all_cores")
@pytest.mark.parametrize("n_parts", [1, 2, 5])
def test_parts_are_computed_in_their_order_and_threads_are_restored(n_parts):
    before = torch.get_num_threads()
    threads = map_on_cores(lambda part: (part, torch.get_num_threads()), range(n_parts))
    assert [part for part, _ in threads] == list(range(n_parts))
    assert all(count == max(1, before // min(n_parts, before)) for _, count in threads)
    assert torch.get_num_threads() == before


@pytest.mark.usefixtures("all_cores")
def test_an_error_in_a_part_is_raised_and_threads_are_restored():
    def refuse(part):
        raise ValueError(part)

    before = torch.get_num_threads()
    with pytest.raises(ValueError, match="0"):
        map_on_cores(refuse, [0, 1])
    assert torch.get_num_threads() == before
