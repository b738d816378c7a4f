"""The content photographs that a style network is trained on, as Parquet shards of small JPEGs.

Columns: id (the name in the source), width, height, encoded (JPEG bytes). Rows stand in a random
order that the seed fixes.
"""

import json
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from styletrf.configuration import SEEDS, require_at_least, require_within
from styletrf.content.content_sources import ContentSource, decoded_image
from styletrf.errors import InputError
from styletrf.files.zip_damage import ZIP_DAMAGE
from styletrf.prefetch import prefetch
from styletrf.progress import Progress, silent

_SCHEMA = pa.schema(
    [
        ("id", pa.string()),
        ("width", pa.int32()),
        ("height", pa.int32()),
        ("encoded", pa.binary()),
    ]
)
_JPEG_QUALITY = 95
_SHARD_BYTES = 64 * 2**20
_SMALLEST_SIDE_PX = 64
_LONGEST_SIDE_PX = 65_500  # of a JPEG that libjpeg writes
_THREADS, _AHEAD = 8, 32  # most of a fetch is waiting


@dataclass(frozen=True, slots=True)
class ContentConfig:
    """Which images are kept, and how."""

    count: int | None = None  # how many, drawn at random; None: all
    min_side_px: int = 288  # the shorter side is reduced to this, never enlarged
    seed: int = 0
    smallest_count: int = 8  # fewer usable images than this are an error

    def __post_init__(self) -> None:
        require_within(SEEDS, self, "seed")
        require_at_least(1, self, "smallest_count")
        require_at_least(_SMALLEST_SIDE_PX, self, "min_side_px")
        if self.count is not None:
            require_at_least(self.smallest_count, self, "count")


@dataclass(frozen=True, slots=True)
class ContentSummary:
    """The outcome for the source's images; also written as `content.json`."""

    count: int
    skipped: tuple[str, ...]  # names of images that cannot be read, or are too small or too long


class Row(TypedDict):
    """One row of a shard."""

    id: str
    width: int
    height: int
    encoded: bytes


def write_content_images(
    source: ContentSource, folder: Path, config: ContentConfig, progress: Progress = silent
) -> ContentSummary:
    """Writes `content-00000.parquet` and so on (about 64 MB each) and `content.json`.

    The same source and configuration give the same bytes.

    Args:
        source: From `styletrf.content.content_sources` or `styletrf.content.coco_fetch`; it is
            closed in the end.
        folder: An existing, empty folder.
        config: Which images, and their size.
        progress: Called with the number of images kept.

    Raises:
        InputError: Fewer than `config.smallest_count` images are usable, or the source fails.
    """
    order = np.random.default_rng(config.seed).permutation(len(source.names))
    wanted = min(config.count or len(order), len(order))
    shards, skipped = _Shards(folder), []
    rows = prefetch(
        lambda name: (name, _row(source, name, config.min_side_px)),
        (source.names[k] for k in order),
        threads=_THREADS,
        ahead=_AHEAD,
    )
    with closing(source), closing(rows):
        for name, row in rows:
            if row is None:
                skipped.append(name)
            else:
                shards.add(row)
                progress(shards.count, wanted)
            if shards.count == wanted:
                break
    shards.flush()
    if shards.count < config.smallest_count:
        raise _too_few(source, shards.count, skipped, config)
    summary = ContentSummary(shards.count, tuple(sorted(skipped)))
    text = {"count": summary.count, "skipped": summary.skipped, "min_side_px": config.min_side_px}
    (folder / "content.json").write_text(json.dumps(text, indent=1, sort_keys=True) + "\n")
    return summary


class _Shards:
    """Writes rows to numbered files, each when it is large enough."""

    def __init__(self, folder: Path) -> None:
        self.count = 0
        self._folder, self._rows, self._bytes, self._written = folder, list[Row](), 0, 0

    def add(self, row: Row) -> None:
        """Takes one row, and writes those that wait once they are 64 MB."""
        self._rows.append(row)
        self._bytes += len(row["encoded"])
        self.count += 1
        if self._bytes >= _SHARD_BYTES:
            self.flush()

    def flush(self) -> None:
        """Writes the rows that wait, if any."""
        if not self._rows:
            return
        path = self._folder / f"content-{self._written:05d}.parquet"
        table = pa.Table.from_pylist(self._rows, schema=_SCHEMA)
        pq.write_table(table, path, compression="none", use_dictionary=False)
        self._rows, self._bytes, self._written = [], 0, self._written + 1


def _row(source: ContentSource, name: str, min_side_px: int) -> Row | None:
    """Reads, reduces and encodes one image; None where it cannot be used."""
    try:
        image = decoded_image(source.read(name))
    except ZIP_DAMAGE:
        return None
    if image is None or min(image.shape[:2]) < _SMALLEST_SIDE_PX:
        return None
    height, width = image.shape[:2]
    scale = min_side_px / min(height, width)
    if scale < 1:
        width, height = round(width * scale), round(height * scale)
        image = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    if max(width, height) > _LONGEST_SIDE_PX:
        return None
    jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1]
    return {"id": name, "width": width, "height": height, "encoded": jpeg.tobytes()}


def _too_few(
    source: ContentSource, count: int, skipped: list[str], config: ContentConfig
) -> InputError:
    problem = f"{count} usable images, at least {config.smallest_count} are needed"
    if skipped:
        named = ", ".join(sorted(skipped)[:5]) + (", ..." if len(skipped) > 5 else "")
        problem += f" ({len(skipped)} cannot be read or are too small: {named})"
    return InputError(source.subject, problem, "Add photographs or replace the damaged ones")
