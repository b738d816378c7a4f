import dataclasses

import numpy as np
import pyarrow.parquet as pq

from styletrf.geometry.point_table import SparsePoints, read_points, write_points


def made(count, seed=0):
    rng = np.random.default_rng(seed)
    lengths = rng.integers(2, 6, count)
    observations = int(lengths.sum())
    return SparsePoints(
        xyz_world=rng.normal(size=(count, 3)),
        rgb=rng.integers(0, 256, (count, 3)).astype(np.uint8),
        error_px=rng.random(count),
        observed_point=np.repeat(np.arange(count), lengths),
        observed_image=rng.integers(0, 9, observations),
        observed_pixel=rng.random((observations, 2)) * 100,
    )


def assert_same(one, other):
    for field in dataclasses.fields(SparsePoints):
        assert np.array_equal(getattr(one, field.name), getattr(other, field.name)), field.name


def test_points_survive_the_round_trip(tmp_path):
    for count in (0, 1, 50):
        write_points(tmp_path / "points.parquet", made(count))
        assert_same(read_points(tmp_path / "points.parquet"), made(count))


def test_observations_are_grouped_by_point(tmp_path):
    points = made(20)
    shuffled = np.random.default_rng(1).permutation(len(points.observed_point))
    mixed = dataclasses.replace(
        points,
        observed_point=points.observed_point[shuffled],
        observed_image=points.observed_image[shuffled],
        observed_pixel=points.observed_pixel[shuffled],
    )
    write_points(tmp_path / "points.parquet", mixed)
    found = read_points(tmp_path / "points.parquet")
    assert np.array_equal(found.observed_point, points.observed_point)
    as_set = {
        (point, image, *pixel)
        for point, image, pixel in zip(
            points.observed_point, points.observed_image, points.observed_pixel, strict=True
        )
    }
    assert as_set == {
        (point, image, *pixel)
        for point, image, pixel in zip(
            found.observed_point, found.observed_image, found.observed_pixel, strict=True
        )
    }


def test_the_same_points_give_the_same_bytes(tmp_path):
    for name in "ab":
        write_points(tmp_path / name, made(30))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_other_tools_see_one_row_a_point_with_its_track(tmp_path):
    points = made(10)
    write_points(tmp_path / "points.parquet", points)
    row = pq.read_table(tmp_path / "points.parquet").to_pylist()[3]
    assert (row["x"], row["y"], row["z"]) == tuple(points.xyz_world[3])
    assert (row["red"], row["green"], row["blue"]) == tuple(points.rgb[3])
    assert len(row["track_image"]) == len(row["track_x"]) == points.track_length[3]
