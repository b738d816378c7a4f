"""Gaussian splats (Kerbl et al. 2023, 3D Gaussian Splatting) of one color each."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.geometry.rotations import matrices_of, quaternions_of


@dataclass(frozen=True, slots=True)
class Splats:
    """Gaussians with opacities, in some world; colors lie beside them, one bank for each style.

    Attributes:
        centers: In the world.
        scales: Standard deviations along the axes of each, above 0, in the world's unit.
        rotations: Unit quaternions w x y z: world from the axes of each.
        opacities: At the centers, in [0, 1].
    """

    centers: Float[np.ndarray, "splats 3"]
    scales: Float[np.ndarray, "splats 3"]
    rotations: Float[np.ndarray, "splats 4"]
    opacities: Float[np.ndarray, " splats"]

    def __len__(self) -> int:
        return len(self.centers)

    def covariances(self) -> Float[np.ndarray, "splats 3 3"]:
        """Returns the covariances R S^2 R^T, in the world."""
        half = matrices_of(self.rotations) * self.scales[:, None, :]
        covariances: Float[np.ndarray, "splats 3 3"] = half @ half.transpose(0, 2, 1)
        return covariances

    def chosen(self, index: np.ndarray) -> "Splats":
        """Returns some of the splats, in the order of the index."""
        return Splats(*(getattr(self, name)[index] for name in self.__slots__))


@dataclass(frozen=True, slots=True)
class SplatTensors:
    """Gaussians with opacities as tensors of float32.

    Attributes:
        centers: In the world.
        scales: Standard deviations along the axes of each, above 0, in the world's unit.
        rotations: Quaternions w x y z of any positive length: world from the axes of each.
        opacities: At the centers, in [0, 1].
    """

    centers: Float[Tensor, "splats 3"]
    scales: Float[Tensor, "splats 3"]
    rotations: Float[Tensor, "splats 4"]
    opacities: Float[Tensor, " splats"]


def tensors_of(splats: Splats) -> SplatTensors:
    """Returns the splats as tensors."""
    arrays = (getattr(splats, name) for name in Splats.__slots__)
    return SplatTensors(*(torch.from_numpy(each.astype(np.float32)) for each in arrays))


def splats_of_tensors(splats: SplatTensors) -> Splats:
    """Returns the splats of tensors, with quaternions of length 1."""
    rotations = torch.nn.functional.normalize(splats.rotations, dim=1)
    parts = (splats.centers, splats.scales, rotations, splats.opacities)
    return Splats(*(part.detach().double().numpy() for part in parts))


def splats_of(
    centers: Float[np.ndarray, "splats 3"], covariances: Float[np.ndarray, "splats 3 3"]
) -> Splats:
    """Returns opaque splats with these covariances, which are positive definite."""
    variances, axes = np.linalg.eigh(covariances)
    axes = axes * np.sign(np.linalg.det(axes))[:, None, None]  # rotations, not reflections
    return Splats(centers, np.sqrt(variances), quaternions_of(axes), np.ones(len(centers)))


def moved_splats(splats: Splats, new_from_world: Float[np.ndarray, "4 4"]) -> Splats:
    """Returns the splats in a new world, reached by a similarity without reflection."""
    linear, offset = new_from_world[:3, :3], new_from_world[:3, 3]
    scale = np.cbrt(np.linalg.det(linear))
    rotations = quaternions_of((linear / scale) @ matrices_of(splats.rotations))
    return replace(
        splats,
        centers=splats.centers @ linear.T + offset,
        scales=splats.scales * scale,
        rotations=rotations,
    )
