"""The installation compiles kernels in the types in which they run, so no first use waits."""

from collections.abc import Callable

import numba
import numpy as np
import pytest
import torch
from splat_clouds import cloud

from styletrf.exports import splat_pictures
from styletrf.exports.splat_fit import Pictures, SplatFitConfig, fitted_splats
from styletrf.exports.splats import tensors_of
from styletrf.geometry.cameras import Camera
from styletrf.kernel_compilation import (
    compile_courtyard_and_matching_kernels,
    compile_splat_kernels,
)
from styletrf.synthetic.courtyard import panorama
from styletrf.synthetic.courtyard.capture import CourtyardConfig
from styletrf.synthetic.courtyard.paths import walk_poses


def fit_splats() -> None:
    camera = Camera("front", 8, 6, 8.0, 8.0, 4.0, 3.0, np.eye(3, 4))
    seen = Pictures([camera], [torch.full((6, 8, 6), 0.5)], torch.zeros(6))
    fitted_splats(tensors_of(cloud(4)), seen, SplatFitConfig(iterations=1))


def look_around() -> None:
    (pose,) = walk_poses(1, np.random.default_rng(0))
    panorama.render_panorama(pose, 4, CourtyardConfig())


@pytest.mark.parametrize(
    ("module", "kernel", "compilation", "use"),
    [
        (splat_pictures, "composite", compile_splat_kernels, fit_splats),
        (splat_pictures, "composite_backward", compile_splat_kernels, fit_splats),
        (panorama, "_trace", compile_courtyard_and_matching_kernels, look_around),
    ],
    ids=["splats", "gradients of splats", "panoramas"],
)
def test_a_kernel_is_compiled_in_the_types_of_its_use(
    monkeypatch: pytest.MonkeyPatch,
    module,
    kernel: str,
    compilation: Callable[[], None],
    use: Callable[[], None],
):
    real, types = getattr(module, kernel), set()

    def spied(*arguments):
        types.add(tuple(map(numba.typeof, arguments)))
        return real(*arguments)

    monkeypatch.setattr(module, kernel, spied)
    compilation()
    compiled = frozenset(types)
    use()
    assert types == compiled != set()
