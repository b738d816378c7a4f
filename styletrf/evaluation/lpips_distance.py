"""LPIPS (Zhang et al. 2018) by its authors' package, where that is installed with its weights.

An optional extra (`pip install .[lpips]`); nothing is downloaded here. The package brings the
weights of its layers; those of AlexNet and VGG16 are torchvision's, and lie where torch keeps what
it has downloaded.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float

from styletrf.errors import InputError
from styletrf.files.published_weights import ALEXNET, VGG16

Image = Float[np.ndarray, "height width 3"]

_WEIGHTS = {"alex": ALEXNET, "vgg": VGG16}


def lpips_metric(
    device: torch.device, network: Literal["alex", "vgg"] = "alex"
) -> Callable[[Image, Image], float]:
    """Returns a function that measures the distance of two images in [0, 1] (version 0.1).

    Args:
        device: The device that computes.
        network: The network whose features are compared: AlexNet, or VGG16.

    Raises:
        InputError: The package is not installed, or the weights are not there.
    """
    path = Path(torch.hub.get_dir(), "checkpoints", _WEIGHTS[network])
    try:
        import lpips
    except (ImportError, RuntimeError) as error:  # the latter from torchvision of another build
        problem = f"needs the package lpips, which cannot be imported ({error})"
        remedy = "Install lpips, and torchvision of the build that torch is, or leave it out"
        raise InputError("LPIPS", problem, remedy) from error
    if not path.is_file():
        problem = "is not there: weights of a network that LPIPS needs"
        raise InputError(str(path), problem, "Fetch torchvision's there, or leave LPIPS out")
    metric = lpips.LPIPS(net=network, verbose=False).eval().to(device)

    @torch.inference_mode()
    def distance(image: Image, reference: Image) -> float:
        tensors = [
            torch.from_numpy(np.ascontiguousarray(i, dtype=np.float32)).permute(2, 0, 1)[None]
            for i in (image, reference)
        ]
        return float(metric(*(t.to(device) for t in tensors), normalize=True))

    return distance
