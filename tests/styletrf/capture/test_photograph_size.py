import numpy as np
import pytest
from expected_errors import rejects
from made_photographs import encoded, png_with_exif, texture, with_exif

from styletrf.capture.photograph_size import photograph_size
from styletrf.capture.photographs import read_photograph

JPEG = encoded(texture(40, 60))
PNG = encoded(texture(40, 60), ".png")
CLEAR_PNG = encoded(np.dstack([texture(40, 60), texture(40, 60)[..., 0]]), ".png")


def with_xmp(jpeg, orientation):
    """The JPEG with an orientation that OpenCV does not read."""
    body = b'http://ns.adobe.com/xap/1.0/\0<rdf tiff:Orientation="%d"/>' % orientation
    return jpeg[:2] + b"\xff\xe1" + (len(body) + 2).to_bytes(2) + body + jpeg[2:]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.jpg", JPEG),
        ("turned.jpg", with_exif(JPEG, orientation=6)),
        ("upright.jpg", with_exif(JPEG, orientation=1)),
        ("xmp.jpg", with_xmp(JPEG, orientation=6)),
        ("a.png", PNG),
        ("turned.png", png_with_exif(PNG, orientation=6)),
        ("behind.png", png_with_exif(PNG, orientation=6, is_behind=True)),
        ("clear.png", png_with_exif(CLEAR_PNG, orientation=8, is_behind=True)),
        ("a.tif", encoded(texture(40, 60), ".tif")),
        ("a.webp", encoded(texture(40, 60), ".webp")),
    ],
)
def test_the_size_is_that_of_the_upright_pixels(name, content, tmp_path):
    (tmp_path / name).write_bytes(content)
    height, width, _ = read_photograph(tmp_path / name).shape
    assert photograph_size(tmp_path / name) == (width, height)


def test_what_is_no_photograph_has_no_size(tmp_path):
    (tmp_path / "a.png").write_bytes(b"no image")
    with rejects(tmp_path / "a.png", "image"):
        photograph_size(tmp_path / "a.png")
