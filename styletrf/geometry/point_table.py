"""Sparse points in Parquet: one row a point, readable by any tool.

Columns: x, y, z (world); red, green, blue; error_px; and the track as three lists of equal length:
track_image (the row of the image in `cameras.parquet`), track_x, track_y (its undistorted pixel).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from jaxtyping import Float, Int, UInt8

from styletrf.finiteness import require_finite_file


@dataclass(frozen=True, slots=True)
class SparsePoints:
    """Triangulated points and where they were seen.

    An observation says that point `observed_point` (a row of `xyz_world`) appears in image
    `observed_image` (a row of the camera table) at `observed_pixel`; they are grouped by point.
    """

    xyz_world: Float[np.ndarray, "points 3"]
    rgb: UInt8[np.ndarray, "points 3"]
    error_px: Float[np.ndarray, " points"]
    observed_point: Int[np.ndarray, " observations"]
    observed_image: Int[np.ndarray, " observations"]
    observed_pixel: Float[np.ndarray, "observations 2"]

    @property
    def track_length(self) -> Int[np.ndarray, " points"]:
        """The number of images in which each point was seen."""
        return np.bincount(self.observed_point, minlength=len(self.xyz_world))

    def of_images(self, images: Sequence[int]) -> "SparsePoints":
        """Returns all points with the observations of some images, numbered in the order given."""
        numbers = np.full(int(self.observed_image.max(initial=-1)) + 1, -1)
        rows = np.array(images, np.int64)
        numbers[rows[rows < len(numbers)]] = np.flatnonzero(rows < len(numbers))
        image = numbers[self.observed_image]
        kept = image >= 0
        return replace(
            self,
            observed_point=self.observed_point[kept],
            observed_image=image[kept],
            observed_pixel=self.observed_pixel[kept],
        )


def write_points(path: Path, points: SparsePoints) -> None:
    """Writes the points in their order, each with its observations in theirs."""
    order = np.argsort(points.observed_point, kind="stable")
    offsets = pa.array(np.concatenate([[0], np.cumsum(points.track_length)]), pa.int32())
    columns: dict[str, pa.Array] = {}
    for name, values in zip("xyz", points.xyz_world.T, strict=True):
        columns[name] = pa.array(values, pa.float64())
    for name, values in zip(("red", "green", "blue"), points.rgb.T, strict=True):
        columns[name] = pa.array(values, pa.uint8())
    columns["error_px"] = pa.array(points.error_px, pa.float64())
    for name, values in (
        ("track_image", pa.array(points.observed_image[order], pa.int32())),
        ("track_x", pa.array(points.observed_pixel[order, 0], pa.float64())),
        ("track_y", pa.array(points.observed_pixel[order, 1], pa.float64())),
    ):
        columns[name] = pa.ListArray.from_arrays(offsets, values)
    pq.write_table(pa.table(columns), path)


def read_points(path: Path) -> SparsePoints:
    """Returns the points that `write_points` wrote.

    Raises:
        InputError: The coordinates of a point are not finite.
    """
    table = pq.read_table(path)
    require_finite_file(path, [(f"column {name}", table[name].to_numpy()) for name in "xyz"])
    tracks = table["track_image"].combine_chunks()
    return SparsePoints(
        xyz_world=_columns(table, "x", "y", "z"),
        rgb=_columns(table, "red", "green", "blue"),
        error_px=table["error_px"].to_numpy(),
        observed_point=np.repeat(np.arange(len(table)), tracks.value_lengths().to_numpy()),
        observed_image=tracks.flatten().to_numpy().astype(np.int64),
        observed_pixel=np.stack(
            [table[name].combine_chunks().flatten().to_numpy() for name in ("track_x", "track_y")],
            axis=-1,
        ),
    )


def _columns(table: pa.Table, *names: str) -> np.ndarray:
    return np.stack([table[name].to_numpy() for name in names], axis=-1)
