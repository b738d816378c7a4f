"""RAFT (Teed and Deng 2020) as torchvision ships it: optical flow by a network.

An optional extra (`pip install .[raft]`, of the build that torch is); nothing is downloaded here.
The weights are torchvision's `Raft_Large_Weights.C_T_SKHT_V2`, where torch keeps downloads.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from styletrf.errors import InputError
from styletrf.files.digests import require_sha256
from styletrf.files.published_weights import RAFT

_STRIDE, _LEAST_PX = 8, 128  # of its coarse grid, and of four levels of correlation on that

Image = Float[np.ndarray, "height width 3"]
Flow = Float[np.ndarray, "height width 2"]


def raft_estimator(
    device: torch.device | str = "cpu", folder: Path | None = None, updates: int = 12
) -> Callable[[Image, Image], Flow]:
    """Returns a function that estimates the flow (x, y) in pixels between two frames in [0, 1].

    Args:
        device: The device that computes.
        folder: The folder of the weights; by default the `checkpoints` of torch's hub folder.
        updates: How often the network refines the flow; 12 is torchvision's default.

    Raises:
        InputError: torchvision is not installed, or its weights are missing or not the published
            ones.
    """
    folder = folder or Path(torch.hub.get_dir(), "checkpoints")
    network = _network(folder / RAFT).to(device)

    @torch.inference_mode()
    def estimate(a: Image, b: Image) -> Flow:
        height, width = a.shape[:2]
        flow: Tensor = network(*(_padded(i).to(device) for i in (a, b)), updates)[-1][0]
        return flow[:, :height, :width].permute(1, 2, 0).contiguous().cpu().numpy()

    return estimate


def _network(path: Path) -> Any:
    try:
        from torchvision.models.optical_flow import raft_large
    except (ImportError, RuntimeError) as error:  # the latter from a build for another torch
        problem = f"needs torchvision, which cannot be imported ({error})"
        remedy = "Install torchvision of the build that torch is, or use dis"
        raise InputError("flow `raft`", problem, remedy) from error
    return _loaded(raft_large(weights=None), path)


def _loaded(network: torch.nn.Module, path: Path) -> torch.nn.Module:
    remedy = "Fetch torchvision's Raft_Large_Weights.C_T_SKHT_V2 there, or use dis"
    if not path.is_file():
        raise InputError(str(path), "is not there: the weights of the flow `raft`", remedy)
    require_sha256(str(path), path.read_bytes(), path.stem[-8:], remedy)
    network.load_state_dict(torch.load(path, map_location="cpu", weights_only=True))
    return network.requires_grad_(requires_grad=False).eval()


def _padded(image: Image) -> Float[Tensor, "1 3 _ _"]:
    """Returns the frame in [-1, 1], its last row and column repeated to a size that RAFT takes."""
    tensor = torch.from_numpy(np.ascontiguousarray(image, dtype=np.float32)).permute(2, 0, 1)[None]
    right, below = (max(-(-n // _STRIDE) * _STRIDE, _LEAST_PX) - n for n in image.shape[1::-1])
    return functional.pad(2 * tensor.clamp(0, 1) - 1, (0, right, 0, below), mode="replicate")
