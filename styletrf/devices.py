"""The device that computes."""

import time
from functools import cache

import torch
from torch.nn.functional import conv2d

from styletrf.errors import InputError

_NAMES = ("auto", "cpu", "cuda")


def device_named(name: str) -> torch.device:
    """Returns the device for `auto`, `cpu` or `cuda`; `auto` is a GPU where one can be used.

    Raises:
        InputError: The name is another, or it is `cuda` and there is no such device.
    """
    if name not in _NAMES:
        remedy = f"Choose one of {', '.join(_NAMES)}"
        raise InputError(f"--device {name}", "is not a device", remedy)
    has_gpu = torch.cuda.is_available()
    if name == "cuda" and not has_gpu:
        raise InputError(
            "--device cuda",
            "this machine, or this build of torch, has no usable CUDA device",
            "Use --device auto or cpu, or install a CUDA build of torch",
        )
    return torch.device("cuda" if has_gpu and name != "cpu" else "cpu")


@cache
def is_faster_in_bfloat16(device: torch.device) -> bool:
    """Returns whether convolutions take less time in bfloat16 than in float32 on a device.

    A processor's features do not decide this: with AVX512-BF16 alone, some processors need half of
    float32's time and others nearly twice as much. So the CPU computes one small convolution in
    both, once in a process, which takes some 40 ms. Emulation counts as slower.
    """
    if device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    capabilities = torch.cpu.get_capabilities()
    if not (capabilities.get("avx512_bf16") or capabilities.get("amx_bf16")):
        return False
    runs = [(dtype, _convolution_s(dtype)) for _ in range(5) for dtype in _DTYPES]
    fastest = {dtype: min(s for run, s in runs[2:] if run == dtype) for dtype in _DTYPES}
    return fastest[torch.bfloat16] < fastest[torch.float32]


_DTYPES = (torch.float32, torch.bfloat16)


def _convolution_s(dtype: torch.dtype) -> float:
    """Returns the seconds of a convolution as those of VGG16's second block, on the CPU."""
    image = torch.ones((1, 128, 48, 48), dtype=dtype)
    weight = torch.ones((128, 128, 3, 3), dtype=dtype)
    with torch.inference_mode():
        started = time.perf_counter()
        conv2d(image, weight, padding=1)
        return time.perf_counter() - started
