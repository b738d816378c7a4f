"""Which device computes."""

import torch

from styletrf.errors import InputError


def device_named(name: str) -> torch.device:
    """Returns the device for `auto`, `cpu` or `cuda`; `auto` is a GPU where one can be used.

    Raises:
        InputError: `cuda` was asked for and there is none.
    """
    has_gpu = torch.cuda.is_available()
    if name == "cuda" and not has_gpu:
        raise InputError(
            "--device cuda",
            "this machine, or this build of torch, has no usable CUDA device",
            "Use --device auto or cpu, or install a CUDA build of torch",
        )
    return torch.device("cuda" if has_gpu and name != "cpu" else "cpu")


def computes_in_bfloat16(device: torch.device) -> bool:
    """Tells whether the hardware multiplies bfloat16 itself; emulation is slower than float32."""
    if device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    capabilities = torch.cpu.get_capabilities()
    return bool(capabilities.get("avx512_bf16") or capabilities.get("amx_bf16"))
