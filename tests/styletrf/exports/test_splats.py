"""Splats: their covariances, their pictures, and what is solved of them."""

from dataclasses import replace

import numba
import numpy as np
import pytest
import torch
from splat_clouds import cloud

from styletrf.exports.export_views import SurfacePoints
from styletrf.exports.splat_fit import (
    Pictures,
    SplatFitConfig,
    fitted_splats,
    mean_colors,
)
from styletrf.exports.splat_pictures import splat_picture
from styletrf.exports.splat_placement import placed_splats, voxels_of
from styletrf.exports.splat_projection import BLUR_PX2
from styletrf.exports.splats import (
    Splats,
    SplatTensors,
    moved_splats,
    splats_of,
    splats_of_tensors,
    tensors_of,
)
from styletrf.geometry.cameras import Camera
from styletrf.geometry.rotations import matrices_of

BLACK = torch.zeros(3)
EXTREMES = pytest.mark.extremes("Splats")


def camera(size: int = 33) -> Camera:
    pose = np.hstack([np.eye(3), np.zeros((3, 1))])
    return Camera("front", size, size, 40.0, 40.0, size / 2, size / 2, pose)


def single(depth: float, sigma: float, opacity: float) -> Splats:
    splats = splats_of(np.array([[0.0, 0.0, depth]]), sigma**2 * np.eye(3)[None])
    return replace(splats, opacities=np.array([opacity]))


def parts_of(splats: SplatTensors) -> dict[str, torch.Tensor]:
    return {name: getattr(splats, name) for name in SplatTensors.__slots__}


def test_splats_have_the_covariances_they_are_made_of():
    rng = np.random.default_rng(0)
    half = rng.normal(size=(50, 3, 3))
    covariances = half @ half.transpose(0, 2, 1) + 0.1 * np.eye(3)
    assert np.allclose(splats_of(np.zeros((50, 3)), covariances).covariances(), covariances)


def test_a_similarity_moves_covariances_as_it_moves_points():
    matrix, splats = np.eye(4), cloud(20)
    matrix[:3, :3] = 2.5 * matrices_of(np.array([[0.9, 0.1, -0.3, 0.2]]))[0]
    matrix[:3, 3] = (1, 2, 3)
    linear, placed = matrix[:3, :3], moved_splats(splats, matrix)
    assert np.allclose(placed.covariances(), linear @ splats.covariances() @ linear.T)
    assert np.allclose(placed.centers, splats.centers @ linear.T + matrix[:3, 3])


def test_the_picture_of_one_splat_is_a_gaussian_over_the_background():
    color, behind = torch.tensor([[0.2, 0.5, 0.8]]), torch.full((3,), 0.1)
    found = splat_picture(tensors_of(single(4.0, 0.2, 0.6)), color, camera(), behind)
    variance = (40 * 0.2 / 4) ** 2 + BLUR_PX2
    y, x = np.mgrid[:33, :33] - 16.0
    alpha = 0.6 * np.exp(-(x * x + y * y) / (2 * variance))[..., None]
    expected = alpha * color[0].numpy() + (1 - alpha) * behind.numpy()
    assert np.abs(found.numpy() - expected).max() < 0.005  # what is cut off


def test_a_picture_composites_from_near_to_far_whatever_the_order_of_splats():
    parts = [single(3.0, 0.5, 0.5), single(4.0, 0.5, 0.5)]
    pictures = []
    for order in ([0, 1], [1, 0]):
        both = Splats(*(np.concatenate([getattr(parts[k], n) for k in order])
                        for n in Splats.__slots__))  # fmt: skip
        pictures.append(splat_picture(tensors_of(both), torch.eye(3)[order], camera(), BLACK))
    assert torch.allclose(*pictures)
    assert torch.allclose(pictures[0][16, 16], torch.tensor([0.5, 0.25, 0]), atol=1e-3)


def test_splats_behind_the_camera_are_not_seen():
    splats, behind = tensors_of(single(-4.0, 0.2, 0.9)), torch.full((3,), 0.3)
    picture = splat_picture(splats, torch.ones(1, 3), camera(), behind)
    assert torch.equal(picture, behind.expand(33, 33, 3))


def test_splats_of_one_color_before_that_color_are_not_seen():
    color = torch.tensor([0.2, 0.5, 0.8])
    picture = splat_picture(tensors_of(cloud(200)), color.expand(200, 3), camera(), color)
    assert torch.allclose(picture, color.expand(33, 33, 3), atol=1e-5)


def test_a_large_splat_before_the_camera_keeps_the_picture_finite_in_every_parameter():
    splats = tensors_of(single(0.05, 50.0, 0.99))
    leaves = {name: part.requires_grad_() for name, part in parts_of(splats).items()}
    splat_picture(SplatTensors(**leaves), torch.ones(1, 3), camera(), BLACK).sum().backward()
    assert all(torch.isfinite(leaf.grad).all() for leaf in leaves.values())


@EXTREMES
@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
@pytest.mark.parametrize("opacity", [0.0, 1e-6, 0.5, 1.0])
def test_the_middle_of_a_splat_has_its_opacity_of_its_color_in_a_world_of_any_scale(
    scale: float, opacity: float, stability
):
    splats = tensors_of(single(4 * scale, 0.3 * scale, opacity))
    white, gray = torch.ones(1, 3), torch.full((3,), 0.25)
    middle = splat_picture(splats, white, camera(), gray)[16, 16]
    alpha = min(opacity, 0.99) if opacity >= 1 / 255 else 0.0
    exact = np.full(3, alpha + (1 - alpha) * 0.25)
    stability(f"opacity {opacity:g}, world of scale {scale:g}", middle, exact)


@EXTREMES
@pytest.mark.parametrize("extent", [1e-12, 1e-3, 1.0, 1e6])
def test_pictures_of_splats_of_any_extent_have_finite_gradients(extent: float, stability):
    splats = tensors_of(single(4.0, 1.0, 0.5))
    scales = (splats.scales * extent).requires_grad_()
    color = torch.ones(1, 1)
    shown = splat_picture(replace(splats, scales=scales), color, camera(), torch.zeros(1))
    variance_px2 = (10 * extent) ** 2 + BLUR_PX2
    # between a blurred point and a splat as wide as the picture, which no ray misses
    stability(f"extent {extent:g}, middle", shown[16, 16], np.array([0.5]))
    gradient = torch.autograd.grad(shown[16, 17], scales)[0]
    # d/d sigma of exp(-1 / (2 variance)) / 2 along x; the picture is at most as wide along y
    along_x = 0.5 * np.exp(-0.5 / variance_px2) * 100 * extent / variance_px2**2
    stability(f"extent {extent:g}, gradient", gradient[0, :1], np.array([along_x]), within=1e-4)


@pytest.mark.parametrize("name", [*SplatTensors.__slots__, "colors"])
def test_gradients_of_a_picture_are_those_of_finite_differences(name: str):
    generator = torch.Generator().manual_seed(1)
    values = parts_of(tensors_of(cloud(40)))
    values["colors"] = torch.rand(40, 3, generator=generator)
    wanted = torch.rand(33, 33, 3, generator=generator)

    def error(changed: torch.Tensor) -> torch.Tensor:
        parts = values | {name: changed}
        colors = parts.pop("colors")
        shown = splat_picture(SplatTensors(**parts), colors, camera(), BLACK, least_left=0.0)
        return (shown * wanted).sum()

    start = values[name].clone().requires_grad_()
    error(start).backward()
    slope = start.grad
    assert slope is not None
    direction = torch.randn(slope.shape, generator=generator)
    step = 1e-3 * direction / direction.abs().max() * values[name].abs().mean()
    with torch.no_grad():
        change = (error(start + step) - error(start - step)).double() / 2
    assert change.item() == pytest.approx((slope * step).sum().item(), rel=0.05, abs=2e-3)


def test_the_mean_color_of_a_splat_is_that_of_its_pixels():
    picture = torch.zeros(33, 33, 3)
    picture[:, 17:] = 1.0
    splats = tensors_of(single(4.0, 0.2, 0.6))
    colors = mean_colors(splats, Pictures([camera()], [picture], BLACK))
    assert torch.allclose(colors, torch.full((1, 3), 0.5), atol=0.1)


def test_a_fit_moves_splats_to_where_pictures_show_them_and_finds_the_colors_of_all_looks():
    there, generator = cloud(60), torch.Generator().manual_seed(3)
    colors, behind = torch.rand(60, 6, generator=generator), torch.zeros(6)
    cameras = [camera(), replace(camera(), cx=14.0)]
    pictures = [splat_picture(tensors_of(there), colors, each, behind) for each in cameras]
    rng = np.random.default_rng(3)
    apart = replace(there, centers=there.centers + rng.normal(scale=0.05, size=(60, 3)))

    def errors(iterations: int) -> torch.Tensor:
        fitted, found = fitted_splats(
            tensors_of(apart),
            Pictures(cameras, pictures, behind),
            SplatFitConfig(iterations=iterations),
        )
        shown = splat_picture(fitted, found, cameras[0], behind)
        return (shown - pictures[0]).square().reshape(-1, 2, 3).mean((0, 2))

    assert (errors(300) < 0.1 * errors(1)).all()


@pytest.mark.usefixtures("all_cores")
def test_a_fit_repeated_is_the_same_on_any_number_of_threads():
    splats, pictures = tensors_of(cloud(60)), [torch.full((33, 33, 3), 0.5)]
    seen, config = Pictures([camera()], pictures, BLACK), SplatFitConfig(iterations=5)
    before = numba.get_num_threads()
    results = []
    for threads in (1, before):
        numba.set_num_threads(threads)
        results.append(fitted_splats(splats, seen, config)[1])
    assert torch.equal(*results)


def test_splats_come_back_from_tensors():
    splats = cloud(20)
    again = splats_of_tensors(tensors_of(splats))
    assert np.allclose(again.covariances(), splats.covariances(), rtol=1e-4, atol=1e-6)
    assert np.allclose(again.opacities, splats.opacities)


@pytest.mark.parametrize("most", [1, 10, 500])
def test_there_are_never_more_voxels_than_allowed(most: int):
    points = np.random.default_rng(4).uniform(-1, 1, (3000, 3))
    assert 0 < len(np.unique(voxels_of(points, (64, 64, 64), most))) <= most


def test_splats_of_a_plane_are_flat_along_it():
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform(-1, 1, (20000, 2)), np.zeros(20000)])
    placed = placed_splats(
        SurfacePoints(points, np.full(len(points), 0.02)), points, (64, 64, 64), 400
    )
    thin = matrices_of(placed.rotations)[:, :, 0]  # the axis of the least deviation
    assert len(placed) <= 400
    assert np.median(np.abs(thin[:, 2])) > 0.99
    assert np.allclose(placed.centers[:, 2], 0)
