"""A style network that is trained in a second."""

from pathlib import Path

import torch
from torch import Tensor

from styletrf.style.perceptual.vgg import VGG16
from styletrf.style.style_network import StyleNetworkConfig
from styletrf.style.training.config import StyleTrainingConfig
from styletrf.style.training.trainer import train_style_network

TINY = StyleTrainingConfig(
    network=StyleNetworkConfig(width=4, n_residual=1),
    iterations=8,
    identity_iterations=2,
    warm_start=False,
    batch=1,
    crop_px=32,
    style_px=64,
    learning_rate=3e-3,
    final_learning_rate=1e-3,
    bfloat16=False,
)


def style() -> Tensor:
    """Diagonal stripes of two colors."""
    y, x = torch.meshgrid(torch.arange(64), torch.arange(64), indexing="ij")
    stripes = ((x + y) // 4 % 2).float()[..., None]
    return stripes * torch.tensor([0.9, 0.6, 0.1]) + (1 - stripes) * torch.tensor([0.1, 0.2, 0.5])


def trained(config: StyleTrainingConfig, vgg: VGG16, content: Path, folder: Path, **arguments):
    folder.mkdir(exist_ok=True)
    return train_style_network(config, vgg, style(), content, checkpoint_folder=folder, **arguments)
