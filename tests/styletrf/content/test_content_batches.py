from contextlib import closing
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from expected_errors import rejects

from styletrf.content.content_batches import content_batches, read_content
from styletrf.content.content_images import ContentConfig, write_content_images
from styletrf.content.content_sources import embedded_source


def flat_images(count: int, height: int = 40, width: int = 60) -> list[bytes]:
    """Images each of one gray level of its own, losslessly encoded."""
    levels = (np.full((height, width, 3), 10 * k, np.uint8) for k in range(count))
    return [cv2.imencode(".png", image)[1].tobytes() for image in levels]


def taken(encoded: list[bytes], number: int, **arguments: int) -> list[torch.Tensor]:
    defaults = {"batch": 2, "size_px": 16, "seed": 0}
    with closing(content_batches(encoded, **(defaults | arguments))) as batches:
        return list(islice(batches, number))


def test_a_stream_entered_later_is_the_same_stream():
    images = flat_images(5)
    whole, rest = taken(images, 8), taken(images, 3, start=5)
    assert all(torch.equal(a, b) for a, b in zip(whole[5:], rest, strict=True))


def test_every_image_is_used_once_an_epoch_in_an_order_of_its_own():
    levels = torch.stack([batch[:, 0, 0, 0] for batch in taken(flat_images(6), 6)])
    first, second = (255 * levels).round().reshape(2, 6).tolist()
    assert sorted(first) == sorted(second) == [0, 10, 20, 30, 40, 50]
    assert first != second


def test_the_seed_changes_the_stream():
    images = flat_images(5)
    pairs = zip(taken(images, 5), taken(images, 5, seed=1), strict=True)
    assert any(not torch.equal(a, b) for a, b in pairs)


@pytest.mark.parametrize(("height", "width"), [(40, 60), (16, 16), (10, 12)])
def test_crops_have_the_size_asked_for(height: int, width: int):
    (batch,) = taken(flat_images(3, height, width), 1, batch=3, size_px=16)
    assert batch.shape == (3, 3, 16, 16)
    assert batch.dtype == torch.float32


def test_crops_are_upright_or_mirrored_squares_of_the_image():
    y, x = np.mgrid[0:64, 0:96]
    image = np.dstack([np.full_like(x, 128), y, x]).astype(np.uint8)  # BGR: R is x, G is y
    encoded = [cv2.imencode(".png", image)[1].tobytes()]
    mirrored = set()
    for (crop,) in taken(encoded, 12, batch=1, size_px=32):
        red, green, blue = 255 * crop
        slope_x, slope_y = red.diff(dim=1).mean(), green.diff(dim=0).mean()
        assert blue.round().unique().tolist() == [128]
        assert 1 <= slope_y.round(decimals=1) <= 2
        assert abs(slope_x) == pytest.approx(float(slope_y), abs=0.1)
        mirrored.add(bool(slope_x < 0))
    assert mirrored == {True, False}


def test_shards_give_back_their_images(tmp_path: Path):
    source = embedded_source([], n_procedural=8, seed=0)
    write_content_images(source, tmp_path, ContentConfig(min_side_px=64))
    assert len(read_content(tmp_path)) == 8
    (batch,) = taken(read_content(tmp_path), 1, batch=4, size_px=48)
    assert 0 <= batch.min() < batch.max() <= 1


def test_a_folder_without_shards_is_an_input_error(tmp_path: Path):
    with rejects(tmp_path):
        read_content(tmp_path)
