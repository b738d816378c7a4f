"""Scenes with cameras that are given."""

from functools import cache

import numpy as np
import pycolmap
from made_photographs import encoded, room_view

VIEWS = 6


WIDTH, HEIGHT, FOCAL = 320, 240, 260.0


BENT = pycolmap.Camera(
    model="OPENCV",
    width=WIDTH,
    height=HEIGHT,
    params=[FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2, 0.05, -0.02, 0.001, -0.001],
)


def photographed(folder, lens, poses, names=None):
    """The room's photographs in `images`, or where their names say."""
    names = names or [f"images/{index}.png" for index in range(len(poses))]
    for name, pose in zip(names, poses, strict=True):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        params = tuple(lens.params.tolist())
        png = _png(pose.tobytes(), lens.model_name, lens.width, lens.height, params)
        (folder / name).write_bytes(png)


@cache
def _png(pose, model, width, height, params):
    """The same photograph is taken for many scenes."""
    lens = pycolmap.Camera(model=model, width=width, height=height, params=params)
    return encoded(room_view(np.frombuffer(pose).reshape(3, 4), lens), ".png")


def colmap(folder, poses, *, text=False):
    photographed(folder, BENT, poses)
    model = pycolmap.Reconstruction()
    lens = pycolmap.Camera(model=BENT.model, width=WIDTH, height=HEIGHT, params=BENT.params)
    lens.camera_id = 1
    model.add_camera_with_trivial_rig(lens)
    for index, pose in enumerate(poses):
        image = pycolmap.Image(name=f"{index}.png", camera_id=1, image_id=index + 1)
        rigid = pycolmap.Rigid3d(pycolmap.Rotation3d(pose[:, :3]), pose[:, 3])
        model.add_image_with_trivial_frame(image, rigid.inverse())
    (folder / "sparse" / "0").mkdir(parents=True)
    (model.write_text if text else model.write_binary)(folder / "sparse" / "0")
