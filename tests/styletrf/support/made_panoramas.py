"""Panoramas made for tests: metadata that say so, and renders of the courtyard."""

import struct
from functools import cache

import numpy as np

from styletrf.synthetic.courtyard import CourtyardConfig
from styletrf.synthetic.courtyard.panorama import render_panorama
from styletrf.synthetic.courtyard.paths import walk_poses

_SPHERICAL_UUID = bytes.fromhex("ffcc8263f8554a938814587a02521fdd")  # Spherical Video V1
_SPHERICAL_XML = (
    b'<?xml version="1.0"?><rdf:SphericalVideo xmlns:rdf="rdf" xmlns:GSpherical="g">'
    b"<GSpherical:Spherical>true</GSpherical:Spherical>"
    b"<GSpherical:Stitched>true</GSpherical:Stitched>"
    b"<GSpherical:StitchingSoftware>made</GSpherical:StitchingSoftware>"
    b"<GSpherical:ProjectionType>equirectangular</GSpherical:ProjectionType>"
    b"</rdf:SphericalVideo>"
)


def with_xmp(jpeg, **values):
    """Returns the JPEG with Photo Sphere XMP that has these values."""
    said = " ".join(f'GPano:{name}="{value}"' for name, value in values.items())
    body = f"http://ns.adobe.com/xap/1.0/\0<rdf:Description {said}/>".encode()
    return jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + jpeg[2:]


def with_spherical_metadata(mp4):
    """Returns the MP4 with the box that marks its first track as spherical."""
    payload = _SPHERICAL_UUID + _SPHERICAL_XML
    box = struct.pack(">I4s", len(payload) + 8, b"uuid") + payload
    moov = mp4.index(b"moov") - 4
    trak = mp4.index(b"trak", moov) - 4
    changed = bytearray(mp4)
    for start in (moov, trak):
        size = struct.unpack_from(">I", changed, start)[0]
        struct.pack_into(">I", changed, start, size + len(box))
    if moov < mp4.index(b"mdat"):  # what the track points to moves
        table = mp4.index(b"stco", trak)
        count = struct.unpack_from(">I", changed, table + 8)[0]
        for k in range(count):
            offset = struct.unpack_from(">I", changed, table + 12 + 4 * k)[0]
            struct.pack_into(">I", changed, table + 12 + 4 * k, offset + len(box))
    end = trak + struct.unpack_from(">I", mp4, trak)[0]
    return bytes(changed[:end]) + box + bytes(changed[end:])


@cache
def courtyard_panoramas(count, width):
    """Returns world_from_panorama (count, 3, 4) along a walk, and what is seen there."""
    poses = walk_poses(count, np.random.default_rng(3))
    config = CourtyardConfig(kind="walk")
    return poses, [render_panorama(pose, width, config) for pose in poses]
