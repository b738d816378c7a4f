"""The colors of a field: components from factors, and the shading that decodes them.

    color(x, d) = shading(components(x), d)                             (TensoRF eq. 6)

The density is a module of its own (`styletrf.field.radiance_field`): several appearances can share
one.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence

import torch
from jaxtyping import Float, Int64
from torch import Tensor, nn

from styletrf.field.field_config import FieldConfig
from styletrf.field.kernels import Kernels
from styletrf.field.shading import ColorNetwork, DiffuseColor, Shading
from styletrf.field.tensor_vm import TensorVM


class ColorModel(nn.Module, ABC):
    """Colors of positions: an appearance, or a mixture of several."""

    @abstractmethod
    def weight_powers(
        self, positions: Float[Tensor, "samples 3"]
    ) -> float | Float[Tensor, " samples"]:
        """Returns the power of all samples' weights, or of each; see `weight_sharpening`.

        Args:
            positions: In the grid's coordinates.
        """

    @abstractmethod
    def components(
        self, positions: Float[Tensor, "samples 3"], kernels: Kernels
    ) -> Float[Tensor, "samples components"]:
        """Returns the components, linear along a ray: deferred shading decodes their weighted mean.

        Args:
            positions: In the grid's coordinates.
            kernels: The backend to compute with.
        """

    @abstractmethod
    def decode(
        self,
        components: Float[Tensor, "samples components"],
        view_directions: Float[Tensor, "rays 3"],
        ray: Int64[Tensor, " samples"],
        kernels: Kernels,
    ) -> Float[Tensor, "samples 3"]:
        """Returns colors in [0, 1], see `Shading.decode`."""

    @abstractmethod
    def background_color(self) -> Float[Tensor, " 3"]:
        """Returns the color behind everything, in [0, 1]."""


class Appearance(ColorModel):
    """Factors, shading and the background behind it all."""

    def __init__(
        self,
        config: FieldConfig,
        resolution: Sequence[int],
        generator: torch.Generator | None = None,
    ) -> None:
        super().__init__()
        self.factors = TensorVM(resolution, config.appearance_ranks, generator=generator)
        components = sum(config.appearance_ranks)
        self.shading: Shading = (
            DiffuseColor(components, generator)
            if config.shading == "plain"
            else ColorNetwork(components, config.features, config.hidden, generator)
        )
        self.background = nn.Parameter(torch.zeros(3))
        self.weight_power = 1.0

    def network_parameters(self) -> list[nn.Parameter]:
        """Returns everything but the factors."""
        return [self.background, *self.shading.parameters()]

    def weight_powers(self, positions: Tensor) -> float:  # noqa: ARG002
        """See `ColorModel.weight_powers`; the power is the same everywhere."""
        return self.weight_power

    def components(self, positions: Tensor, kernels: Kernels) -> Tensor:
        """See `ColorModel.components`."""
        return kernels.features(self.factors, positions)

    def decode(
        self, components: Tensor, view_directions: Tensor, ray: Tensor, kernels: Kernels
    ) -> Tensor:
        """See `ColorModel.decode`."""
        return self.shading.decode(components, view_directions, ray, kernels)

    def background_color(self) -> Tensor:
        """See `ColorModel.background_color`."""
        return torch.sigmoid(self.background)
