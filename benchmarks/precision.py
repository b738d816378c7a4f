"""What networks cost here in float32 and in bfloat16: `python benchmarks/precision.py`.

A row of JSON is printed a measurement: the least seconds of some repetitions in each precision,
which alternate. Decision 50 has figures of it.
"""

import json
import sys
import time
from collections.abc import Callable

import torch
from torch.nn.functional import conv2d

from styletrf.devices import is_faster_in_bfloat16
from styletrf.style.perceptual.vgg import VGG16

REPETITIONS = 7
DTYPES = (torch.float32, torch.bfloat16)


def convolution(dtype: torch.dtype) -> None:
    """Computes one layer of 128 channels for two images of 96x96."""
    image, weight = torch.ones((2, 128, 96, 96), dtype=dtype), torch.ones((128, 128, 3, 3))
    with torch.inference_mode():
        conv2d(image, weight.to(dtype), padding=1)


def features(dtype: torch.dtype) -> None:
    """Computes VGG16 up to relu3_3 for two images of 192x192, and the gradient of these."""
    image = torch.full((2, 3, 192, 192), 0.5, requires_grad=True)
    with torch.autocast("cpu", dtype, enabled=dtype != torch.float32):
        found = VGG.features(image, ["relu3_3"])["relu3_3"]
    found.float().sum().backward()


VGG = VGG16().requires_grad_(requires_grad=False)


def least_seconds(work: Callable[[torch.dtype], None]) -> dict[str, float]:
    """Returns the least seconds in each precision."""
    seconds: dict[str, list[float]] = {str(dtype): [] for dtype in DTYPES}
    for _ in range(1 + REPETITIONS):
        for dtype in DTYPES:
            started = time.perf_counter()
            work(dtype)
            seconds[str(dtype)].append(time.perf_counter() - started)
    return {name: round(min(taken[1:]), 4) for name, taken in seconds.items()}


def main() -> None:
    """Prints the measurements."""
    for work in (convolution, features):
        _say({"work": work.__name__, **least_seconds(work)})
    _say({"is faster in bfloat16": is_faster_in_bfloat16(torch.device("cpu"))})


def _say(row: dict[str, object]) -> None:
    sys.stdout.write(json.dumps(row) + "\n")


if __name__ == "__main__":
    main()
