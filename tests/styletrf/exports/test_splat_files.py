"""Files of splats, opened by published readers that are not the project's own."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from expected_errors import rejects
from splat_clouds import cloud

from styletrf.exports.splat_files import read_splats, storable_in_spz, write_splat_ply, write_spz

gsply = pytest.importorskip("gsply", reason="gsply is not installed (extra export)")


def test_a_ply_has_the_properties_that_3dgs_writes(tmp_path: Path):
    plyfile = pytest.importorskip("plyfile", reason="plyfile is not installed")
    splats, colors = cloud(30), np.random.default_rng(0).uniform(size=(30, 3))
    write_splat_ply(tmp_path / "a.ply", splats, colors)
    vertices = plyfile.PlyData.read(tmp_path / "a.ply")["vertex"]
    names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"]
    names += [f"scale_{k}" for k in range(3)] + [f"rot_{k}" for k in range(4)]
    assert {each.name for each in vertices.properties} >= set(names)
    assert np.allclose(np.column_stack([vertices[n] for n in "xyz"]), splats.centers, atol=1e-6)
    assert np.allclose(1 / (1 + np.exp(-vertices["opacity"])), splats.opacities, atol=1e-5)
    assert np.allclose(0.5 + 0.28209479 * vertices["f_dc_1"], colors[:, 1], atol=1e-5)
    assert np.allclose(np.exp(vertices["scale_2"]), splats.scales[:, 2], rtol=1e-5)


@pytest.mark.parametrize(("suffix", "fraction"), [("ply", 1e-5), ("spz", 0.05)])
def test_what_is_read_is_what_was_written_up_to_rounding(
    suffix: str, fraction: float, tmp_path: Path
):
    splats, colors = cloud(300), np.random.default_rng(0).uniform(size=(300, 3))
    path = tmp_path / f"a.{suffix}"
    {"ply": write_splat_ply, "spz": write_spz}[suffix](path, splats, colors)
    again, found = read_splats(path)
    assert np.allclose(again.centers, splats.centers, atol=1e-5)
    assert np.allclose(np.abs((again.rotations * splats.rotations).sum(axis=1)), 1, atol=1e-3)
    assert np.allclose(again.scales, splats.scales, rtol=fraction)
    assert np.allclose(again.opacities, splats.opacities, atol=0.005)
    assert np.allclose(found, colors, atol=0.005)


def test_an_spz_has_its_own_axes(tmp_path: Path):
    splats = cloud(30)
    write_spz(tmp_path / "a.spz", splats, np.full((30, 3), 0.5))
    means = np.asarray(gsply.read_spz(tmp_path / "a.spz").means)
    assert np.allclose(means, splats.centers * (1, -1, -1), atol=1e-5)


def test_an_spz_holds_scenes_of_kilometers(tmp_path: Path):
    splats = replace(cloud(30), centers=cloud(30).centers * 2000)
    write_spz(tmp_path / "a.spz", splats, np.full((30, 3), 0.5))
    assert np.allclose(read_splats(tmp_path / "a.spz")[0].centers, splats.centers, atol=0.01)


def test_an_spz_of_splats_beyond_its_range_is_refused(tmp_path: Path):
    """All had the farthest position that fits."""
    splats = replace(cloud(30), centers=cloud(30).centers + 2.0**22)
    with rejects("splats", remedy=["ply"]):
        write_spz(tmp_path / "a.spz", splats, np.full((30, 3), 0.5))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("far", [0, 1, 3])
def test_an_spz_leaves_out_no_more_than_one_splat_in_a_thousand(far: int, tmp_path: Path):
    splats = cloud(3000)
    splats.centers[:far] *= 2.0**22
    near = storable_in_spz(splats)
    assert np.flatnonzero(~near).tolist() == list(range(far))
    write_spz(tmp_path / "a.spz", splats.chosen(near), np.full((3000 - far, 3), 0.5))
    splats.centers[:4] *= 2.0**22
    with rejects("splats", remedy=["ply"]):
        storable_in_spz(splats)


def test_three_hundred_thousand_splats_take_at_most_6_mb(tmp_path: Path):
    splats, colors = cloud(300_000), np.random.default_rng(0).uniform(size=(300_000, 3))
    write_spz(tmp_path / "a.spz", splats, colors)
    assert (tmp_path / "a.spz").stat().st_size <= 6_000_000 + 1000
