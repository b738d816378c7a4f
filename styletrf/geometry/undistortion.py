"""Replaces a lens that bends lines by a pinhole camera of the same size, without blank pixels."""

import math

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from styletrf.colmap import pycolmap
from styletrf.errors import InputError
from styletrf.geometry.cameras import Camera, directions_of_all_pixels

_INSIDE_PX = 0.01
_WIDEST_SLOPE = 2.0  # half an image's width over its focal length: 127 degrees
_LARGEST_ZOOM = 1e6


def pinhole_for(lens: pycolmap.Camera, name: str, world_from_camera: np.ndarray) -> Camera:
    """Returns the pinhole camera of the same size and principal point that a lens can fill.

    Its focal lengths are those of the lens times the smallest zoom at which every edge of the
    image lies within the undistorted edge of the photograph, so that no pixel is left blank. The
    model of a wide lens may fold back within the photograph, or show directions behind the camera:
    then the zoom is the smallest at which the image's edges lie before the fold, 127 degrees apart
    at most.

    Raises:
        InputError: The lens fills no image, as one that bends lines and whose principal point is
            outside the photograph, one of a panorama, or one of no size or focal length.
    """
    zoom = _zoom(lens)
    if zoom > _LARGEST_ZOOM:
        of = f"{lens.model_name} {lens.params.tolist()} of {lens.width}x{lens.height} pixels"
        problem = f"no pinhole camera replaces its lens {of}"
        raise InputError(f"photograph {name}", problem, "Check the lens of its poses")
    fx, fy, cx, cy = _intrinsics(lens)
    return Camera(name, lens.width, lens.height, fx * zoom, fy * zoom, cx, cy, world_from_camera)


def _zoom(lens: pycolmap.Camera) -> float:
    """Returns the zoom of `pinhole_for`; infinity where there is none."""
    if not lens.focal_length_idxs():  # of a panorama
        return math.inf
    lengths_px = (*_intrinsics(lens)[:2], lens.width, lens.height)
    if not all(0 < length < math.inf for length in lengths_px):
        return math.inf
    zoom = _edge_zoom(lens)
    return zoom if _is_filled(lens, zoom) else _filling_zoom(lens)


def _edge_zoom(lens: pycolmap.Camera) -> float:
    """Returns the smallest zoom at which the image lies within the undistorted edges.

    It is NaN if the lens model shows no direction at some point of the edges.
    """
    fx, fy, cx, cy = _intrinsics(lens)
    width, height = lens.width, lens.height
    x, y = np.linspace(0, width, 65), np.linspace(0, height, 65)
    left, right = (lens.cam_from_img(_points(edge, y))[:, 0] for edge in (0.0, float(width)))
    top, bottom = (lens.cam_from_img(_points(x, edge))[:, 1] for edge in (0.0, float(height)))
    zooms = (
        cx / (-fx * left).min(),
        (width - cx) / (fx * right).min(),
        cy / (-fy * top).min(),
        (height - cy) / (fy * bottom).min(),
    )
    return float(np.max(zooms))


def _is_filled(lens: pycolmap.Camera, zoom: float) -> bool:
    """Returns whether the lens shows each direction of a pinhole image's edges, and once only."""
    if not zoom > 0:
        return False
    focal, principal = np.split(np.array(_intrinsics(lens)), 2)
    size_px = np.array([lens.width, lens.height], dtype=np.float64)
    fraction = np.linspace(0, 1, 65)
    edges = [_points(*pair) for side in (0.0, 1.0) for pair in ((fraction, side), (side, fraction))]
    directions = (np.concatenate(edges) * size_px - principal) / (focal * zoom)
    pixels = lens.img_from_cam(np.column_stack([directions, np.ones(len(directions))]))
    back = lens.cam_from_img(pixels)
    is_inside = ((pixels > -_INSIDE_PX) & (pixels < size_px + _INSIDE_PX)).all()
    return bool(is_inside and np.allclose(back, directions, rtol=1e-4, atol=1e-6))


def _filling_zoom(lens: pycolmap.Camera) -> float:
    """Returns the smallest zoom, to a thousandth, at which the lens fills an image not too wide.

    It is infinite where there is none up to a million.
    """
    fx, fy, *_ = _intrinsics(lens)
    low = max(lens.width / fx, lens.height / fy) / (2 * _WIDEST_SLOPE)
    high = low
    while not _is_filled(lens, high):
        low, high = high, 2 * high
        if high > _LARGEST_ZOOM:
            return math.inf
    while high - low > 1e-3 * high:
        middle = (low + high) / 2
        low, high = (low, middle) if _is_filled(lens, middle) else (middle, high)
    return high


def undistorted_image(
    image: UInt8[np.ndarray, "height width 3"], lens: pycolmap.Camera, pinhole: Camera
) -> UInt8[np.ndarray, "height width 3"]:
    """Returns the photograph as the pinhole camera sees it (bicubic)."""
    rays = directions_of_all_pixels(pinhole)
    sources = lens.img_from_cam(rays).reshape(pinhole.height, pinhole.width, 2) - 0.5
    x, y = np.moveaxis(sources.astype(np.float32), -1, 0)
    warped = cv2.remap(image, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(warped, dtype=np.uint8)


def undistorted_pixels(
    pixels: Float[np.ndarray, "pixels 2"], lens: pycolmap.Camera, pinhole: Camera
) -> Float[np.ndarray, "pixels 2"]:
    """Returns the pixels of the pinhole camera for the lens's `pixels`."""
    on_plane = lens.cam_from_img(pixels)
    return np.asarray(on_plane * (pinhole.fx, pinhole.fy) + (pinhole.cx, pinhole.cy))


def _intrinsics(lens: pycolmap.Camera) -> tuple[float, float, float, float]:
    return (
        lens.focal_length_x,
        lens.focal_length_y,
        lens.principal_point_x,
        lens.principal_point_y,
    )


def _points(x: float | np.ndarray, y: float | np.ndarray) -> np.ndarray:
    return np.stack(np.broadcast_arrays(x, y), axis=-1).astype(np.float64)
