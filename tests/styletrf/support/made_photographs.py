"""Photographs made for tests: encoded files with EXIF, and views of a textured corner of a room."""

import io
import struct
import zlib
from functools import cache

import cv2
import numpy as np
import pycolmap
from PIL import Image

_PNG_BEGIN_BYTES, _PNG_END_BYTES = 33, 12  # signature and IHDR; IEND


@cache
def texture(height, width, seed=0):
    """Returns noise of several scales, uint8 RGB: something to find features in."""
    rng = np.random.default_rng(seed)
    image = np.zeros((height, width, 3))
    for cell in (4, 8, 16, 32):
        coarse = rng.random((height // cell + 2, width // cell + 2, 3))
        image += cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    image = (image - image.min()) / (image.max() - image.min())
    return np.rint(image * 255).astype(np.uint8)


def encoded(image, suffix=".jpg", *flags):
    """Returns an RGB, gray or RGBA image as the bytes of a file."""
    if image.ndim == 3:
        order = [2, 1, 0, 3][: image.shape[2]]
        image = np.ascontiguousarray(image[..., order])
    return cv2.imencode(suffix, image, list(flags))[1].tobytes()


def with_exif(jpeg, orientation=1, focal_35mm=0):
    """Returns the JPEG with an EXIF block: which way up it is, and the lens (0: unknown)."""
    body = b"Exif\0\0" + _exif(orientation, focal_35mm)
    return jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + jpeg[2:]


def png_with_exif(png, orientation, *, is_behind=False):
    """Returns the PNG with an EXIF block before its pixels, or behind them."""
    block = b"eXIf" + _exif(orientation)
    chunk = struct.pack(">I", len(block) - 4) + block + struct.pack(">I", zlib.crc32(block))
    place = -_PNG_END_BYTES if is_behind else _PNG_BEGIN_BYTES
    return png[:place] + chunk + png[place:]


def tiff_of(image, orientation):
    """Returns an RGB image as the bytes of a TIFF that says which way up it is."""
    file = io.BytesIO()
    Image.fromarray(image).save(file, "TIFF", tiffinfo={0x0112: orientation})
    return file.getvalue()


def _exif(orientation, focal_35mm=0):
    entries = [struct.pack("<HHIHxx", 0x0112, 3, 1, orientation)]
    tail = b""
    if focal_35mm:
        entries.append(struct.pack("<HHII", 0x8769, 4, 1, 8 + 2 + 2 * 12 + 4))
        tail = struct.pack("<H", 1) + struct.pack("<HHIHxx", 0xA405, 3, 1, focal_35mm) + bytes(4)
    ifd = struct.pack("<H", len(entries)) + b"".join(entries) + bytes(4)
    return b"II*\0" + struct.pack("<I", 8) + ifd + tail


LENS = pycolmap.Camera(
    model="SIMPLE_RADIAL", width=240, height=180, params=[225.0, 120.0, 90.0, -0.06]
)


def room_poses(count):
    """Returns world_from_camera (count, 3, 4): an arc of views into the corner at the origin."""
    poses = []
    for angle in np.linspace(0.35, 1.2, count):
        center = np.array([4 * np.cos(angle), 4 * np.sin(angle), 1.8 + 0.5 * np.sin(3 * angle)])
        forward = np.array([0.5, 0.5, 0.8]) - center
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0, 0, 1])
        right /= np.linalg.norm(right)
        poses.append(np.column_stack([right, np.cross(forward, right), forward, center]))
    return np.array(poses)


def room_view(world_from_camera, lens=LENS, seed=0):
    """Returns the photograph of three textured walls, x = 0, y = 0 and z = 0, through the lens."""
    y, x = np.mgrid[0 : lens.height, 0 : lens.width] + 0.5
    rays = lens.cam_from_img(np.stack([x, y], axis=-1).reshape(-1, 2))
    directions = np.column_stack([rays, np.ones(len(rays))]) @ world_from_camera[:, :3].T
    center = world_from_camera[:, 3]
    with np.errstate(divide="ignore"):
        distances = np.where(directions < 0, -center / directions, np.inf)
    wall = distances.argmin(axis=1)
    points = center + distances.min(axis=1)[:, None] * directions
    colors = np.zeros((len(rays), 3), np.uint8)
    for axis in range(3):
        on_wall = np.delete(points, axis, axis=1).astype(np.float32) * 120
        a, b = on_wall.reshape(lens.height, lens.width, 2).transpose(2, 0, 1)
        painted = cv2.remap(
            texture(1024, 1024, seed=axis + 3 * seed),
            a,
            b,
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_WRAP,
        )
        colors[wall == axis] = painted.reshape(-1, 3)[wall == axis]
    return colors.reshape(lens.height, lens.width, 3)
