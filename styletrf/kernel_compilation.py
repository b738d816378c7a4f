"""Compiles the kernels ahead of their first use: `python -m styletrf.kernel_compilation`.

The installation runs it, for about a minute. `styletrf.compiled` says where numba keeps the code.
"""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory


def compile_field_kernels() -> None:
    """Runs each kernel of the field on the CPU once, in the types of a fit."""
    import torch  # here, as below, since each of the two processes needs its own half alone

    from styletrf.evaluation.calibration.workloads import field_trainer
    from styletrf.field.kernels import kernels_for

    cpu = torch.device("cpu")
    trainer = field_trainer(cpu)
    trainer.step()
    with torch.no_grad():  # as the occupancy evaluates density
        kernels_for(cpu).density(trainer.field.density.factors, torch.zeros(1, 3))


def compile_courtyard_and_matching_kernels() -> None:
    """Renders two small views of the courtyard and one all around, and matches two features."""
    import numpy as np

    from styletrf.sfm.matching.mutual_matches import mutual_matches
    from styletrf.synthetic.courtyard.capture import CourtyardConfig
    from styletrf.synthetic.courtyard.folder import write_courtyard
    from styletrf.synthetic.courtyard.panorama import render_panorama

    with TemporaryDirectory() as folder:
        write_courtyard(Path(folder), CourtyardConfig(n_views=2, width=16, height=12))
    render_panorama(np.eye(3, 4), 2, CourtyardConfig())
    feature = np.full((1, 128), 45, np.uint8)
    mutual_matches(feature, [feature])


def compile_viewer_kernels() -> None:
    """Runs each kernel of the viewer on a brick, in the types of baking."""
    import numpy as np

    from styletrf.viewer import lattice_kernels, refit_kernels
    from styletrf.viewer.view_directions import MONOMIALS

    slots, low = np.zeros((2, 2, 2), np.int32), np.zeros((1, 3), np.int64)
    rest, weights, values = (np.zeros(shape, np.float32) for shape in ((1, 3), 1, (512, 6)))
    lattice_kernels.interpolated(slots, low, rest, values)
    lattice_kernels.add_squares(slots, low, rest, weights, 1, np.zeros((512, 3), np.float32))
    codes = np.zeros((1, 512), np.int32)
    lattice_kernels.multiples(codes, codes, 1, 1)
    starts, of_samples = np.array([0, 1]), np.float32(0)
    samples = slots, low.astype(np.int16), rest, weights
    refit_kernels.totals(*samples, starts, rest, 512, of_samples)
    sums = np.empty((refit_kernels.BANDS, *values.shape), np.float32)
    tint = np.zeros((len(MONOMIALS), 3), np.float32)
    refit_kernels.residuals(*samples, rest, starts, rest, tint, 1, values, of_samples, sums)


def compile_splat_kernels() -> None:
    """Draws a splat, and differentiates the picture, in the types of a fit."""
    import numpy as np
    import torch

    from styletrf.exports.splat_pictures import splat_picture
    from styletrf.exports.splats import splats_of, tensors_of
    from styletrf.geometry.cameras import Camera

    splat = tensors_of(splats_of(np.array([[0.0, 0.0, 1.0]]), np.eye(3)[None]))
    camera = Camera("front", 2, 2, 2.0, 2.0, 1.0, 1.0, np.eye(3, 4))
    colors = torch.ones(1, 3, requires_grad=True)
    splat_picture(splat, colors, camera, torch.zeros(3)).sum().backward()


def compile_all_but_the_field() -> None:
    """Compiles the kernels outside of the field, which together take less time than the field's."""
    compile_courtyard_and_matching_kernels()
    compile_viewer_kernels()
    compile_splat_kernels()


COMPILATIONS: tuple[Callable[[], None], ...] = (
    compile_field_kernels,
    compile_all_but_the_field,
)


def main() -> None:
    """Compiles all kernels, in two processes at once."""
    with ProcessPoolExecutor(len(COMPILATIONS), mp_context=get_context("spawn")) as pool:
        for compilation in [pool.submit(each) for each in COMPILATIONS]:
            compilation.result()


if __name__ == "__main__":
    main()
