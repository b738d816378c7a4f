"""A mask on a view: its opaque white counts, at any size, but not stretched over the view."""

from pathlib import Path

import numpy as np
import pytest
from captures import looking
from expected_errors import rejects
from made_photographs import encoded

from styletrf.files.float_images import write_float_image
from styletrf.geometry.camera_table import write_cameras
from styletrf.stylization.region import masked_on

CAMERA = looking(np.array([0.0, 0.0, -3.0]), np.zeros(3))  # 60x45


@pytest.fixture
def renders(tmp_path: Path) -> Path:
    """A folder with one render of a wall."""
    (tmp_path / "frames").mkdir()
    ones = np.ones((CAMERA.height, CAMERA.width), np.float32)
    write_float_image(tmp_path / f"frames/{CAMERA.name}.exr", np.dstack([ones] * 3), ones, 3 * ones)
    write_cameras(tmp_path / "cameras.parquet", [CAMERA])
    return tmp_path


def saved(folder: Path, mask: np.ndarray) -> Path:
    (folder / "mask.png").write_bytes(encoded(mask, ".png"))
    return folder / "mask.png"


@pytest.mark.parametrize("hidden", [0, 255])
@pytest.mark.parametrize("scale", [1, 2])
def test_a_mask_painted_on_an_empty_layer_counts_where_it_is_painted(renders, scale, hidden):
    layer = np.full((scale * CAMERA.height, scale * CAMERA.width, 4), hidden, np.uint8)
    layer[..., 3] = 0
    layer[:, : scale * 20] = 255
    region = masked_on(renders, CAMERA.name, saved(renders, layer))
    assert (region.mask[:, :20] == 1).all()
    assert (region.mask[:, 20:] == 0).all()


@pytest.mark.parametrize(("width", "height"), [(60, 45), (120, 91), (7, 5), (605, 450), (1, 1)])
def test_a_mask_is_of_the_proportions_of_its_view_up_to_one_percent_or_a_pixel(
    renders, width, height
):
    mask = saved(renders, np.full((height, width), 255, np.uint8))
    np.testing.assert_allclose(masked_on(renders, CAMERA.name, mask).mask, 1, atol=1e-5)


@pytest.mark.parametrize(("width", "height"), [(45, 60), (60, 48), (640, 470), (45, 45)])
def test_a_mask_of_other_proportions_than_its_view_is_refused(renders, width, height):
    mask = saved(renders, np.full((height, width), 255, np.uint8))
    with rejects("--region", f"{width}x{height}", "60x45"):
        masked_on(renders, CAMERA.name, mask)


def test_a_mask_without_opaque_white_is_refused(renders):
    layer = np.full((45, 60, 4), [255, 255, 255, 0], np.uint8)
    with rejects("--region", "transparent"):
        masked_on(renders, CAMERA.name, saved(renders, layer))
