import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from expected_errors import rejects
from PIL import Image

from styletrf.capture.photographs import PHOTOGRAPH_SUFFIXES, read_photograph
from styletrf.content.content_sources import (
    CONTENT_SUFFIXES,
    decoded_image,
    embedded_source,
    folder_source,
    zip_source,
)

PHONE = Path(__file__).parents[1] / "photographs" / "phone.heic"


def test_every_kind_of_photograph_can_be_content():
    """A folder of HEIC files was passed over without a word."""
    assert CONTENT_SUFFIXES == PHOTOGRAPH_SUFFIXES


@pytest.mark.parametrize("suffix", [".heic", ".avif", ".jp2", ".ppm", ".tiff", ".jfif"])
def test_content_is_decoded_as_photographs_are(tmp_path: Path, suffix: str):
    file, pixels = tmp_path / f"a{suffix}", read_photograph(PHONE)
    if suffix == ".heic":
        file.write_bytes(PHONE.read_bytes())
    elif suffix == ".jp2":
        cv2.imwrite(str(file), pixels[..., ::-1])
    else:
        kinds = {".avif": "AVIF", ".ppm": "PPM", ".tiff": "TIFF", ".jfif": "JPEG"}
        Image.fromarray(pixels).save(file, kinds[suffix])
    decoded = decoded_image(file.read_bytes())
    assert decoded is not None
    assert np.array_equal(decoded[..., ::-1], read_photograph(file))


def test_folder_is_searched_to_its_depth_in_a_fixed_order(tmp_path: Path):
    for name in ("b.JPG", "a/z.png", "a/notes.txt", ".hidden/x.jpg", "a/.y.jpg"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(name)
    source = folder_source(tmp_path)
    assert source.names == ("a/z.png", "b.JPG")
    assert source.read("a/z.png") == b"a/z.png"


def test_zip_is_read_without_unpacking(tmp_path: Path):
    with zipfile.ZipFile(tmp_path / "train.zip", "w") as archive:
        for name in ("train/2.jpg", "train/1.jpg", "train/readme.txt", "__MACOSX/._1.jpg"):
            archive.writestr(name, name)
    source = zip_source(tmp_path / "train.zip")
    assert source.names == ("train/1.jpg", "train/2.jpg")
    assert source.read("train/2.jpg") == b"train/2.jpg"
    assert [file.name for file in tmp_path.iterdir()] == ["train.zip"]


def test_embedded_images_follow_the_seed_and_their_number(tmp_path: Path):
    photograph = tmp_path / "a.jpg"
    photograph.write_bytes(b"a photograph")
    small, large = (embedded_source([photograph], n, seed=3) for n in (2, 4))
    assert small.names == ("photograph-a.jpg", "procedural-00000", "procedural-00001")
    assert small.read("photograph-a.jpg") == b"a photograph"
    assert small.read("procedural-00001") == large.read("procedural-00001")
    assert small.read("procedural-00001") != small.read("procedural-00000")
    assert large.read("procedural-00001") != embedded_source([], 2, seed=4).read("procedural-00001")
    decoded = cv2.imdecode(
        np.frombuffer(small.read("procedural-00000"), np.uint8), cv2.IMREAD_COLOR
    )
    assert decoded is not None


@pytest.mark.parametrize("kind", ["absent", "text", "empty", "name"])
def test_no_zip_of_images_is_an_input_error(tmp_path: Path, kind: str):
    path = tmp_path / "train.zip"
    if kind == "text":
        path.write_text("not a zip")
    elif kind == "empty":
        zipfile.ZipFile(path, "w").close()
    elif kind == "name":  # said to be UTF-8
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("caf\xe9.jpg", "")
        path.write_bytes(path.read_bytes().replace("\xe9".encode(), b"\xe9\xe9"))
    with rejects(path):
        zip_source(path)


def test_no_folder_of_images_is_an_input_error(tmp_path: Path):
    with rejects(tmp_path, ".png"):
        folder_source(tmp_path)
    with rejects(tmp_path / "absent", "folder"):
        folder_source(tmp_path / "absent")
    with rejects("the embedded content", ".png"):
        embedded_source([], 0, seed=0)


def test_a_folder_behind_a_link_is_searched_and_a_loop_of_links_ends(tmp_path: Path):
    for name in ("in/a.png", "disk/b.png", "disk/far/c.png"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    (tmp_path / "in/disk").symlink_to(tmp_path / "disk")
    (tmp_path / "disk/loop").symlink_to(tmp_path / "in")
    source = folder_source(tmp_path / "in")
    assert source.names == ("a.png", "disk/b.png", "disk/far/c.png")
    assert source.read("disk/far/c.png") == b"disk/far/c.png"
