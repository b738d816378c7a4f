"""Measures how much lattice points change pictures, to choose the spacings of their colors.

    effect_k = max over cameras of sqrt(sum_s (w_s h_k(x_s))^2)

with samples s of a camera's rays at x_s, of weight w_s, and the trilinear weight h_k of point k. An
error of the color at k changes the squared error of a picture by its square times effect_k^2. So
for the fewest bits at a given error, spacings are proportional to 1 / effect.
"""

import numpy as np
import torch
from jaxtyping import Float, UInt8

from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import RadianceField
from styletrf.field.weight_sharpening import sharpened
from styletrf.viewer import lattice_kernels
from styletrf.viewer.compression import before, in_contexts, packed_bytes
from styletrf.viewer.lattice import BrickLattice
from styletrf.viewer.visibility import CPU, Views, heavy_samples, of_pixels

CLASSES = 6
"""Classes of effects, halved from one to the next; class 0 has points with less or none."""
Classes = UInt8[np.ndarray, "bricks 512"]
_RAYS = 3_000_000  # of all cameras together, about
_GREATEST = 0.99  # quantile of the effects that counts as the greatest


@torch.no_grad()
def point_effects(
    field: RadianceField, views: Views, lattice: BrickLattice
) -> Float[np.ndarray, "bricks 512"]:
    """Returns the effects of a field's points; 0 where no sample is seen.

    Args:
        field: The field whose density and weight power count.
        views: The views that see it, with those beside them.
        lattice: The lattice of the points.
    """
    kernels = kernels_for(CPU)
    sums = np.zeros((lattice.needed.size, 3), np.float32)
    cameras = views.beside()
    for picture, camera in enumerate(cameras, start=1):
        small = of_pixels(camera, _RAYS / len(cameras))
        samples = sharpened(
            heavy_samples(field, views, small)[0], field.appearance.weight_power, kernels
        )
        low, rest = lattice.cells(samples.positions.numpy())
        at = lattice.slots, low, rest.astype(np.float32)
        lattice_kernels.add_squares(*at, samples.weights.numpy(), picture, sums)
    effects: Float[np.ndarray, "bricks 512"] = np.sqrt(sums[:, 1:].max(axis=1)).reshape(
        lattice.needed.shape
    )
    return np.where(lattice.needed, effects, np.float32(0))


def effect_classes(effects: Float[np.ndarray, "bricks 512"]) -> Classes:
    """Returns 1 for the greatest effects, 2 for half of them, and so on; 0 for the least."""
    seen = effects[effects > 0]
    if not seen.size:
        return np.zeros(effects.shape, np.uint8)
    relative = np.maximum(effects, 1e-30) / np.quantile(seen, _GREATEST)
    halvings = np.floor(-np.log2(relative)).clip(0, CLASSES)
    return np.where(halvings < CLASSES, 1 + halvings, 0).astype(np.uint8)


def packed_classes(classes: Classes) -> tuple[bytes, bytes]:
    """Returns compressed classes, and compressed how many each of their contexts has.

    The context of a class is x + n y + n^2 z, of the n classes before it along x, y and z.
    """
    whole, n = classes.astype(np.int32), CLASSES + 1
    x, y, z = (before(whole, axis) for axis in range(3))
    contexts = x + n * (y + n * z)
    counts = np.bincount(contexts.ravel(), minlength=n**3).astype("<u4")
    ordered = in_contexts(whole, contexts).astype(np.uint8)
    return packed_bytes(ordered), packed_bytes(counts.view(np.uint8))
