"""Frames that measures read: objects that are cut out stand on mean colors."""

import cv2
import numpy as np
import pytest
from captures import arc

from styletrf.files.float_images import write_float_image
from styletrf.files.images import write_rgb
from styletrf.geometry.camera_table import write_cameras
from styletrf.steps.metrics.frame_reader import frames_of, objects_of

CAMERAS = arc(20, n=3)
HEIGHT, WIDTH = 24, 32
DISC = cv2.circle(np.zeros((HEIGHT, WIDTH), np.float32), (16, 12), 8, 1.0, -1)
TEXTURE = np.random.default_rng(0).random((2, HEIGHT, WIDTH, 3)).astype(np.float32)


def frames(folder, ground: float, opacity=DISC):
    """Folders of frames of one object, without and with style, before one color."""
    inputs = {name: folder / name for name in ("unstylized", "stylized")}
    for place in inputs.values():
        (place / "frames").mkdir(parents=True)
    write_cameras(inputs["unstylized"] / "cameras.parquet", CAMERAS)
    plain, painted = (
        opacity[..., None] * texture + (1 - opacity[..., None]) * ground for texture in TEXTURE
    )
    for camera in CAMERAS:
        name = inputs["unstylized"] / "frames" / f"{camera.name}.exr"
        write_float_image(name, plain, opacity, np.ones_like(opacity))
        write_rgb(inputs["stylized"] / "frames" / f"{camera.name}.png", painted)
    return inputs


@pytest.mark.parametrize("on_one_color", [False, True])
def test_an_object_has_its_mean_color_behind_it_whatever_was_there(tmp_path, on_one_color):
    white, black = (
        objects_of(frames(tmp_path / str(ground), ground), on_one_color=on_one_color)
        for ground in (1.0, 0.0)
    )
    inside = DISC > 0
    for camera in CAMERAS:
        plain, painted = white(camera.name)
        own = plain[inside].mean(axis=0), painted[inside].mean(axis=0)
        behind = own[0], own[0] if on_one_color else own[1]
        for image, mean in zip((plain, painted), behind, strict=True):
            np.testing.assert_allclose(
                image[~inside], np.tile(mean, ((~inside).sum(), 1)), atol=0.01
            )
        for one, other in zip((plain, painted), black(camera.name), strict=True):
            np.testing.assert_allclose(one, other, atol=0.01)


def test_an_object_keeps_its_colors_on_its_mean_color(tmp_path):
    inputs = frames(tmp_path, 1.0)
    seen, alone = frames_of(inputs)[1], objects_of(inputs, on_one_color=False)
    for one, other in zip(seen(CAMERAS[0].name), alone(CAMERAS[0].name), strict=True):
        np.testing.assert_allclose(one[DISC > 0], other[DISC > 0], atol=1e-6)


def test_frames_without_a_background_have_no_objects(tmp_path):
    assert objects_of(frames(tmp_path, 1.0, np.ones_like(DISC)), on_one_color=False) is None
