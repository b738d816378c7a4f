"""Decodes an appearance's components to colors, by a small network or directly.

network: color(x, d) = sigmoid(output(relu(hidden(basis(components), d))))    (TensoRF eq. 6)
plain:   color(x) = sigmoid(basis(components)), for scenes that look alike from everywhere
"""

from abc import ABC, abstractmethod
from typing import Literal

import torch
from jaxtyping import Float, Int64
from torch import Tensor, nn

from styletrf.field.kernels import Kernels

ShadingKind = Literal["network", "plain"]


class Shading(nn.Module, ABC):
    """Decodes colors; `basis` is the first layer for the components."""

    basis: nn.Linear

    @abstractmethod
    def decode(
        self,
        components: Float[Tensor, "samples components"],
        view_directions: Float[Tensor, "rays 3"],
        ray: Int64[Tensor, " samples"],
        kernels: Kernels,
    ) -> Float[Tensor, "samples 3"]:
        """Returns the colors of samples in [0, 1], differentiable in components and parameters.

        Args:
            components: The components of each sample.
            view_directions: The view direction of each ray, a unit vector.
            ray: The ray of each sample, ascending.
            kernels: The backend to compute with.
        """

    def freeze_view_dependence(self) -> None:
        """Makes the colors independent of the view direction, for good."""


class ColorNetwork(Shading):
    """One hidden layer on features and view direction."""

    def __init__(
        self, components: int, features: int, hidden: int, generator: torch.Generator | None
    ) -> None:
        super().__init__()
        self.basis = nn.Linear(components, features, bias=False)
        self.hidden = nn.Linear(features + 3, hidden)
        self.output = nn.Linear(hidden, 3)
        self.sees_view = True
        for layer in (self.basis, self.hidden, self.output):
            _spread(layer, generator)
        for layer in (self.hidden, self.output):
            nn.init.zeros_(layer.bias)

    def decode(
        self, components: Tensor, view_directions: Tensor, ray: Tensor, kernels: Kernels
    ) -> Tensor:
        """See `Shading.decode`.

        Basis and first layer are both linear, so their matrices are multiplied beforehand, and the
        term of the view direction is computed once a ray.
        """
        n_features = self.basis.out_features
        of_components = self.hidden.weight[:, :n_features] @ self.basis.weight
        of_directions = self.hidden.weight[:, n_features:]
        if not self.sees_view:
            of_directions = of_directions.detach()  # they stay 0
        of_view = view_directions @ of_directions.T + self.hidden.bias
        layer = self.output
        return kernels.decode(components, of_view, ray, of_components, layer.weight, layer.bias)

    def freeze_view_dependence(self) -> None:
        """Sets the weights of the view to 0, where they stay; see the base class."""
        self.sees_view = False
        with torch.no_grad():
            self.hidden.weight[:, self.basis.out_features :] = 0


class DiffuseColor(Shading):
    """A color that is the same from everywhere."""

    def __init__(self, components: int, generator: torch.Generator | None) -> None:
        super().__init__()
        self.basis = nn.Linear(components, 3, bias=False)
        _spread(self.basis, generator)

    def decode(
        self,
        components: Tensor,
        view_directions: Tensor,  # noqa: ARG002
        ray: Tensor,  # noqa: ARG002
        kernels: Kernels,  # noqa: ARG002
    ) -> Tensor:
        """See `Shading.decode`; the directions do not matter."""
        return torch.sigmoid(components @ self.basis.weight.T)


def _spread(layer: nn.Linear, generator: torch.Generator | None) -> None:
    bound = layer.in_features**-0.5
    nn.init.uniform_(layer.weight, -bound, bound, generator=generator)
