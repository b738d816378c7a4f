"""Which device computes, and in which precision."""

import time
from unittest.mock import patch

import pytest
import torch
from expected_errors import rejects
from torch.nn.functional import conv2d

from styletrf.devices import device_named, is_faster_in_bfloat16

CPU = torch.device("cpu")


def seconds_of_convolution(dtype: torch.dtype) -> float:
    image = torch.ones((2, 64, 64, 64), dtype=dtype)
    weight = torch.ones((64, 64, 3, 3), dtype=dtype)
    with torch.inference_mode():
        started = time.perf_counter()
        conv2d(image, weight, padding=1)
        return time.perf_counter() - started


def test_the_precision_taken_is_not_much_slower_than_the_other():
    """AVX512-BF16 alone makes convolutions of some processors nearly twice as slow."""
    runs = [
        (d, seconds_of_convolution(d)) for _ in range(12) for d in (torch.float32, torch.bfloat16)
    ]
    float32_s, bfloat16_s = (
        min(s for d, s in runs if d == dtype) for dtype in (torch.float32, torch.bfloat16)
    )
    taken, other = float32_s, bfloat16_s
    if is_faster_in_bfloat16(CPU):
        taken, other = other, taken
    assert taken < 1.5 * other


def test_a_processor_without_bfloat16_is_not_asked_to_emulate_it():
    is_faster_in_bfloat16.cache_clear()
    with patch.object(torch.cpu, "get_capabilities", lambda: {"avx2": True}):
        assert not is_faster_in_bfloat16(CPU)
    is_faster_in_bfloat16.cache_clear()


def test_a_process_answers_alike_and_measures_once():
    answers = {is_faster_in_bfloat16(CPU) for _ in range(1000)}
    assert len(answers) == 1
    assert is_faster_in_bfloat16.cache_info().misses <= 1


@pytest.mark.parametrize("name", ["gpu", "CUDA", ""])
def test_an_unknown_device_is_refused(name):
    with rejects(f"--device {name}".strip(), remedy=["auto", "cpu", "cuda"]):
        device_named(name)


@pytest.mark.skipif(torch.cuda.is_available(), reason="this machine has a GPU")
def test_a_gpu_that_is_not_there_is_refused_and_auto_takes_the_cpu():
    with rejects("--device cuda"):
        device_named("cuda")
    assert device_named("auto") == CPU
