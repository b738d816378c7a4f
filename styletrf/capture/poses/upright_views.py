"""Poses of photographs as they are stored, turned upright with their pixels.

A capture turns photographs upright by their EXIF data. COLMAP, and programs that take its poses,
take the stored pixels: of a phone that was held upright these lie on their side, and the poses and
lenses are those of the lying pictures.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Int

from styletrf.capture.poses.given_poses import GivenView, Lens
from styletrf.colmap import pycolmap
from styletrf.geometry.exif_orientation import FIRST_TRANSPOSED, stored_size, upright_axes

_VECTORS = ("p2", "p1"), ("sx1", "sy1"), ("p0", "p1"), ("s0", "s2"), ("s1", "s3")
"""Coefficients of COLMAP's lens models along x and y of the picture; other ones have no direction.

`p1` and `p2` of OpenCV's models are not in the order of x and y.
"""


def upright_views(views: Sequence[GivenView], *, are_stored: bool = False) -> list[GivenView]:
    """Returns the views with the poses and lenses of the upright photographs.

    If EXIF data exchange the width and height of a photograph, the format of its lens says which
    picture the lens is for. Where this is open, as of photographs that stand on their heads, the
    others of the same source say it.

    Args:
        views: The views of one source, whose lenses have their sizes from there. Photographs may be
            missing.
        are_stored: Whether poses are those of stored pictures if no photograph says so.
    """
    sizes = [stored_size(view.file) for view in views]
    found = [_is_of_stored(view.lens, *one) for view, one in zip(views, sizes, strict=True)]
    if decided := [one for one in found if one is not None]:
        are_stored = any(decided)
    are_of_stored = [are_stored if one is None else one for one in found]
    return [
        _turned(view, orientation) if is_of_stored else view
        for view, (_, orientation), is_of_stored in zip(views, sizes, are_of_stored, strict=True)
    ]


def _is_of_stored(lens: Lens, size: tuple[int, int], orientation: int) -> bool | None:
    """Returns whether a lens is that of the stored picture; None if its format leaves that open."""
    width, height = size
    alike = (width - height) * (lens.width - lens.height)
    return None if orientation < FIRST_TRANSPOSED or alike == 0 else alike > 0


def _turned(view: GivenView, orientation: int) -> GivenView:
    """Returns the view of the upright picture; as it is if the stored one is mirrored.

    No camera sees a mirrored scene.
    """
    axes = upright_axes(orientation)
    if np.linalg.det(axes) < 0:
        return view
    upright_from_stored = np.eye(3)
    upright_from_stored[:2, :2] = axes
    pose = view.world_from_camera.copy()
    pose[:, :3] = pose[:, :3] @ upright_from_stored.T
    return replace(view, lens=_turned_lens(view.lens, axes), world_from_camera=pose)


def _turned_lens(lens: Lens, axes: Int[np.ndarray, "2 2"]) -> Lens:
    """Returns the lens of a picture whose axes are turned by quarters about its middle."""
    camera = pycolmap.Camera(
        model=lens.model, width=lens.width, height=lens.height, params=lens.params
    )
    values = dict(zip(camera.params_info.split(", "), lens.params, strict=True))
    size = np.array([lens.width, lens.height])
    turned_size = np.abs(axes) @ size
    for x, y in (("cx", "cy"), ("fx", "fy"), *_VECTORS):
        if {x, y} <= values.keys():
            along = np.array([values[x], values[y]])
            if x == "cx":
                along = axes @ (along - size / 2) + turned_size / 2
            else:
                along = np.abs(axes) @ along if x == "fx" else axes @ along
            values[x], values[y] = map(float, along)
    return Lens(lens.model, tuple(values.values()), int(turned_size[0]), int(turned_size[1]))
