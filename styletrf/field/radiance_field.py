"""The radiance field: VM-split density and appearance, and the shading that decodes a color.

    density(x) = scale * softplus(sum of density components + shift)
    color(x, d) = shading(appearance components, d)                     (TensoRF eq. 6)

The density half and the appearance half are two modules, so that an adaptation can share the first
and own the second.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import torch
from jaxtyping import UInt8
from safetensors.torch import save_file
from torch import Tensor, nn

from styletrf.configuration import configured
from styletrf.field.appearance import Appearance
from styletrf.field.field_config import FieldConfig
from styletrf.field.kernels import March, Sparsification
from styletrf.field.shading import ShadingKind
from styletrf.field.tensor_vm import TensorVM
from styletrf.finiteness import load_finite
from styletrf.geometry.space import Bounds


class Density(nn.Module):
    """The density of a field: its factors, and the occupancy grid of the voxels to sample."""

    occupancy: Tensor

    def __init__(
        self,
        config: FieldConfig,
        resolution: Sequence[int],
        generator: torch.Generator | None = None,
    ) -> None:
        super().__init__()
        mean = (config.initial_raw_density / sum(config.density_ranks)) ** 0.5
        self.factors = TensorVM(resolution, config.density_ranks, mean=mean, generator=generator)
        self.register_buffer("occupancy", torch.ones((1, 1, 1), dtype=torch.uint8))
        self.shift, self.scale = config.density_shift, config.density_scale

    def march(self, termination: float, sparsification: Sparsification | None = None) -> March:
        """Returns the settings by which rays are traced through this density."""
        return March(self.occupancy, self.shift, self.scale, termination, sparsification)


class RadianceField(nn.Module):
    """A density and an appearance on the same grid."""

    def __init__(
        self,
        config: FieldConfig,
        resolution: Sequence[int],
        generator: torch.Generator | None = None,
    ) -> None:
        super().__init__()
        self.config = config
        self.step_length = 0.01  # optical length of a step of the march it was fitted with
        self.bounds = Bounds()  # of its grid within the scene's space
        self.density = Density(config, resolution, generator)
        self.appearance = Appearance(config, resolution, generator)

    @property
    def resolution(self) -> tuple[int, int, int]:
        """Lattice points along x, y, z."""
        return self.density.factors.resolution

    def upsample(self, resolution: Sequence[int]) -> None:
        """Resamples all factors to a finer grid, in place."""
        self.density.factors = self.density.factors.upsampled(resolution)
        self.appearance.factors = self.appearance.factors.upsampled(resolution)


def refine_appearance(
    field: RadianceField, scale: float, shading: ShadingKind, generator: torch.Generator
) -> None:
    """Gives the appearance a lattice and a shading of its own, in place.

    Positions are relative to the box, so that the lattices of density and appearance need not
    agree.

    Args:
        field: The field; its density stays as it is.
        scale: The resolution of the new lattice over that of the present one.
        shading: The kind of shading; where it is not the field's, its weights are new.
        generator: Draws these weights.
    """
    old = field.appearance
    resolution = [max(2, round(scale * side)) for side in old.factors.resolution]
    if shading != field.config.shading:
        field.config = replace(field.config, shading=shading)
        field.appearance = Appearance(field.config, resolution, generator).to(old.background)
        field.appearance.background = old.background
    field.appearance.factors = old.factors.upsampled(resolution)


def save_field(folder: Path, field: RadianceField) -> None:
    """Writes `density.safetensors`, `appearance.safetensors` and `field.json` to the folder.

    Factors are rounded to 16 bits, unless one is beyond 65,504: half the size, and renders that
    no eye can tell from the exact ones (`benchmarks/README.md`).
    """
    save_file(_stored(field.density.state_dict()), folder / "density.safetensors")
    save_appearance(folder, field)


def save_appearance(folder: Path, field: RadianceField) -> None:
    """Writes `appearance.safetensors` and `field.json`: the field but for its density."""
    save_file(_stored(field.appearance.state_dict()), folder / "appearance.safetensors")
    values = {
        "config": asdict(field.config),
        "resolution": list(field.resolution),
        "appearance_resolution": list(field.appearance.factors.resolution),
        "weight_power": field.appearance.weight_power,
        "step_length": field.step_length,
        "bounds": asdict(field.bounds),
    }
    (folder / "field.json").write_text(json.dumps(values, indent=1, sort_keys=True) + "\n")


def load_field(density_folder: Path, appearance_folder: Path | None = None) -> RadianceField:
    """Returns the field whose density is in one folder and whose appearance in another.

    Raises:
        InputError: A tensor is not finite.
    """
    appearance_folder = appearance_folder or density_folder
    values = json.loads((density_folder / "field.json").read_text())
    field = RadianceField(configured(FieldConfig, values["config"]), values["resolution"])
    field.step_length = values["step_length"]
    field.bounds = Bounds(*(tuple(values["bounds"][side]) for side in ("lower", "upper")))
    density = load_finite(density_folder / "density.safetensors")
    set_occupancy(field.density, density["occupancy"])
    field.density.load_state_dict(density)
    of_appearance = json.loads((appearance_folder / "field.json").read_text())
    resolution = of_appearance.get("appearance_resolution", of_appearance["resolution"])
    field.config = configured(FieldConfig, of_appearance["config"])
    field.appearance = Appearance(field.config, resolution)
    field.appearance.weight_power = of_appearance.get("weight_power", 1.0)
    field.appearance.load_state_dict(load_finite(appearance_folder / "appearance.safetensors"))
    return field


def load_stylized_field(field_folder: Path, stylized_folder: Path) -> RadianceField:
    """Returns a stylized field: its own where it has a density, else on that of the field."""
    own = (stylized_folder / "density.safetensors").exists()
    return load_field(stylized_folder if own else field_folder, stylized_folder)


def set_occupancy(density: Density, occupancy: UInt8[Tensor, "x y z"]) -> None:
    """Replaces the occupancy grid, whatever its size."""
    density.occupancy = occupancy


def _stored(state: Mapping[str, Tensor]) -> dict[str, Tensor]:
    return {
        name: (_halved(tensor) if name.startswith("factors.") else tensor).contiguous()
        for name, tensor in state.items()
    }


def _halved(tensor: Tensor) -> Tensor:
    half = tensor.half()
    return half if bool(torch.isfinite(half).all()) else tensor
