"""Batches of random crops of the content photographs: an endless stream, entered anywhere.

Batch k depends on the seed and k alone: a resumed training sees those of one that never stopped.
"""

from collections.abc import Generator
from functools import partial
from itertools import count
from pathlib import Path

import cv2
import numpy as np
import pyarrow.parquet as pq
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from styletrf.errors import InputError
from styletrf.prefetch import prefetch

_THREADS, _AHEAD = 2, 4


def read_content(folder: Path) -> list[bytes]:
    """Returns the encoded images of all shards, in their order (about 40 kB each).

    Raises:
        InputError: The folder holds no shard.
    """
    shards = sorted(folder.glob("content-*.parquet"))
    if not shards:
        raise InputError(str(folder), "holds no content images", "Build the content images again")
    columns = [pq.read_table(shard, columns=["encoded"])["encoded"] for shard in shards]
    return [image.as_py() for column in columns for image in column]


def content_batches(
    encoded: list[bytes], *, batch: int, size_px: int, seed: int, start: int = 0
) -> Generator[Float[Tensor, "batch 3 size size"], None, None]:
    """Yields batches `start`, `start + 1`, ... without end, decoded ahead in two threads.

    The images are taken in a new random order each time all have been used. Each gives a random
    square, of at least `size_px` a side where the image has as many, reduced to `size_px`, and
    mirrored half of the time.

    Args:
        encoded: From `read_content`.
        batch: Crops in a batch.
        size_px: Side of a crop.
        seed: Decides the order, the crops and the mirroring.
        start: The number of the first batch.
    """
    make = partial(_batch, encoded, batch, size_px, seed)
    yield from prefetch(make, count(start), threads=_THREADS, ahead=_AHEAD)


def _batch(
    encoded: list[bytes], batch: int, size_px: int, seed: int, k: int
) -> Float[Tensor, "batch 3 size size"]:
    generator = np.random.default_rng([seed, k])
    images = (encoded[_index(len(encoded), seed, k * batch + j)] for j in range(batch))
    crops = np.stack([_crop(image, size_px, generator) for image in images])
    return torch.from_numpy(crops).permute(0, 3, 1, 2).contiguous().float() / 255


def _index(n_images: int, seed: int, position: int) -> int:
    """Returns the index of the image at a position of the endless sequence of shuffled epochs."""
    epoch, place = divmod(position, n_images)
    return int(np.random.default_rng([seed, epoch, 1]).permutation(n_images)[place])


def _crop(
    encoded: bytes, size_px: int, generator: np.random.Generator
) -> UInt8[np.ndarray, "size size 3"]:
    image = cv2.imdecode(np.frombuffer(encoded, dtype=np.uint8), cv2.IMREAD_COLOR_RGB)
    if image is None:
        raise InputError("the content images", "one does not decode", "Build them again")
    height, width = image.shape[:2]
    short = min(height, width)
    side = int(generator.integers(min(size_px, short), short + 1))
    top, left = generator.integers((height - side + 1, width - side + 1))
    square = image[top : top + side, left : left + side]
    if generator.integers(2):
        square = square[:, ::-1]
    smooth = cv2.INTER_AREA if side >= size_px else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(square, (size_px, size_px), interpolation=smooth))
