"""Colors: shading, mixtures and the cache of rays, whatever goes into them."""

import copy
from dataclasses import replace

import pytest
import torch
from kernel_cases import REFERENCE, generator
from mini_scene import painted_plane

from styletrf.capture.view_images import view_images
from styletrf.field.appearance import Appearance
from styletrf.field.field_config import FieldConfig
from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import RadianceField
from styletrf.field.ray_cache import march_once
from styletrf.field.view_rays import ViewRays
from styletrf.stylization.mixed_appearance import MixedAppearance

SHADING = pytest.mark.extremes("Shading")
MIXTURES = pytest.mark.extremes("Mixed appearances")
CACHE = pytest.mark.extremes("Ray cache")
CPU = torch.device("cpu")
KERNELS = kernels_for(CPU)
SMALL = FieldConfig((2, 1, 1), (2, 1, 1), features=4, hidden=8, density_shift=0.0)


def appearance_of(kind: str, seed: int = 0) -> Appearance:
    return Appearance(replace(SMALL, shading=kind), (4, 3, 5), generator(seed))


def exact_colors(appearance, components, directions, ray):
    wide = copy.deepcopy(appearance).double()
    return wide.decode(components.double(), directions.double(), ray, REFERENCE)


@SHADING
@pytest.mark.parametrize("kind", ["network", "plain"])
@pytest.mark.parametrize("size", [0.0, 1e-30, 1.0, 1e3, 1e18, 1e30])
def test_colors_stay_within_0_and_1_and_have_finite_gradients(backend, kind, size, stability):
    appearance, ray = appearance_of(kind), torch.arange(40)
    components = size * torch.randn(40, 4, generator=generator(1))
    directions = torch.nn.functional.normalize(torch.randn(40, 3, generator=generator(2)))
    components.requires_grad_()
    colors = appearance.decode(components, directions, ray, backend)
    colors.sum().backward()
    assert ((colors >= 0) & (colors <= 1)).all()
    assert torch.isfinite(components.grad).all()
    exact = exact_colors(appearance, components, directions, ray)
    stability(f"{kind}, components of {size:g}", colors, exact)


@SHADING
def test_a_direction_of_no_length_counts_as_none(backend, stability):
    """As for a camera that would lie in its own image plane: the color is that of the features."""
    appearance, ray = appearance_of("network"), torch.arange(5)
    components, nowhere = torch.randn(5, 4, generator=generator(1)), torch.zeros(5, 3)
    colors = appearance.decode(components, nowhere, ray, backend)
    appearance.shading.freeze_view_dependence()
    anywhere = appearance.decode(components, torch.ones(5, 3), ray, backend)
    torch.testing.assert_close(colors, anywhere)
    exact = exact_colors(appearance, components, nowhere, ray)
    stability("view direction 0", colors, exact)


@MIXTURES
@pytest.mark.parametrize("fraction", [0.0, 1e-38, 1e-7, 0.5, 1.0])
def test_a_mixture_lies_between_its_parts(backend, fraction, stability):
    parts = [appearance_of("network", seed) for seed in (0, 1)]
    mixed, ray = MixedAppearance(parts, [1 - fraction, fraction]), torch.arange(30)
    positions = 2 * torch.rand(30, 3, generator=generator(3)) - 1
    directions = torch.nn.functional.normalize(torch.randn(30, 3, generator=generator(4)))
    found = mixed.decode(mixed.components(positions, backend), directions, ray, backend)
    ends = torch.stack(
        [p.decode(p.components(positions, backend), directions, ray, backend) for p in parts]
    )
    assert (found <= ends.amax(dim=0) + 1e-6).all()
    assert (found >= ends.amin(dim=0) - 1e-6).all()
    exact = torch.lerp(*ends.double(), fraction)
    stability(f"share {fraction:g}", found, exact)


@CACHE
@pytest.mark.parametrize("scale", [0.0, 1e-30, 1.0, 1e30, float("inf")])
@pytest.mark.parametrize("min_weight", [0.0, 2e-3, 0.999])
def test_a_cache_keeps_the_light_of_its_rays(scale, min_weight, stability):
    """Kept weights sum to the opacity, or to nothing; of all rays the cached color is in range."""
    scene = painted_plane()
    field = RadianceField(replace(SMALL, density_scale=scale), (8, 8, 8), generator(0))
    rays = ViewRays(scene.cameras, scene.model.space, 0.1, CPU)
    cache = march_once(
        field, rays, view_images(scene.images), torch.arange(400), KERNELS,
        min_weight=min_weight, termination=0.0, cache_bytes=1 << 30,
    )  # fmt: skip
    batch = cache.batch(0, 400)
    mass = torch.zeros(400).double().index_add(0, batch.samples.ray, batch.samples.weights.double())
    torch.testing.assert_close(mass, cache.opacity.double(), rtol=1e-5, atol=1e-6)
    color = batch.color(field.appearance, KERNELS)
    assert ((color >= 0) & (color <= 1 + 1e-6)).all()
    exact = replace(
        batch,
        **{
            name: getattr(batch, name).double() for name in ("view_directions", "opacity", "target")
        },
        samples=_doubled(batch.samples),
    ).color(copy.deepcopy(field.appearance).double(), REFERENCE)
    stability(f"density times {scale:g}", color, exact)


def _doubled(samples):
    wide = {n: getattr(samples, n).double() for n in ("s", "positions", "weights")}
    return replace(samples, **wide)
