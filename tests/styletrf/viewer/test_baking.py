"""What is baked is the field: exactly at lattice points and, but for rounding, between them."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
import torch
from expected_errors import rejects
from lattice_positions import corners, positions_in
from mini_scene import KERNELS

from styletrf.geometry.cameras import Camera
from styletrf.viewer.baking import bake_density, bake_look, require_shared_density
from styletrf.viewer.baking_loss import baking_loss
from styletrf.viewer.camera_bounds import camera_bounds
from styletrf.viewer.coding import FINEST
from styletrf.viewer.color_refit import RefitConfig
from styletrf.viewer.lattice import MOST_BRICKS
from styletrf.viewer.point_effects import effect_classes, point_effects
from styletrf.viewer.seen_points import SeenPoints
from styletrf.viewer.viewer_content import RENDER
from styletrf.viewer.visibility import Views, heavy_samples, seen_voxels

EVERYWHERE = SeenPoints(np.ones((1, 1, 1), bool), MOST_BRICKS)
SPACES = ["ndc", "box", "unbounded"]


@pytest.mark.parametrize("space", SPACES)
def test_baked_densities_interpolate_to_the_field(tiny, content, space):
    field, baked = tiny(space).fields["Photographs"], content(space).density
    at = positions_in(field.density.occupancy.numpy(), 0).astype(np.float32)
    addresses, weights = corners(baked.lattice, at)
    shown = (weights * baked.codes.values()[addresses, 0]).sum(axis=1)
    exact = KERNELS.density(field.density.factors, torch.from_numpy(at)).detach().numpy()
    assert baked.reduced_from is None
    assert np.abs(shown - exact).max() < 0.51 * baked.codes.step + 1e-4


@pytest.mark.parametrize("space", SPACES)
def test_pictures_of_photographs_have_38_db_and_of_paintings_45(tiny, content, space):
    scene = tiny(space)
    photographs, *styles = content(space).looks
    assert photographs.slope_codes is not None
    shown, finest = (
        baking_loss(scene.fields[photographs.name], views(scene), appearance=each.appearance())
        for each in (photographs, replace(photographs, spacings=FINEST))
    )
    assert shown.least_db > max(38, min(finest.least_db - 0.25, 45.4))
    for look in styles:
        assert look.slope_codes is None
        loss = baking_loss(scene.fields[look.name], views(scene), appearance=look.appearance())
        assert loss.least_db >= 45.4


def views(scene) -> Views:
    return Views(scene.model.space, scene.cameras, RENDER)


def test_a_refit_is_nearer_than_the_colors_along_one_direction(tiny):
    scene = tiny("box")
    field = scene.fields["Photographs"]
    none, some = (
        bake_look("", field, views(scene), EVERYWHERE, RefitConfig(passes=passes)).psnr_db
        for passes in (0, 2)
    )
    assert some > none + 1


def test_points_with_little_effect_are_coarser_or_take_the_mean_of_their_neighbors(tiny):
    scene = tiny("box")
    field, of = scene.fields["style 1"], views(scene)
    seen = SeenPoints(seen_voxels(field, of), MOST_BRICKS)
    look = bake_look("", field, of, seen, RefitConfig())
    assert list(look.spacings[1:]) != list(FINEST[1:])
    effects = point_effects(field, of, look.lattice)
    np.testing.assert_array_equal(look.classes, effect_classes(effects))
    assert not effects[~look.lattice.needed].any()


def test_photographs_share_the_points_and_classes_of_a_painting_with_the_same_weights(content):
    photographs, same, sharper = content("box").looks
    assert photographs.weight_power == same.weight_power != sharper.weight_power
    assert photographs.lattice.resolution == same.lattice.resolution
    assert photographs.classes is same.classes
    assert photographs.classes is not sharper.classes


def test_a_lattice_with_too_many_bricks_is_made_coarser_and_says_what_that_costs(tiny):
    scene = tiny("ndc")
    field = scene.fields["style 1"]
    whole = bake_density(field, views(scene))
    most = whole.lattice.n_bricks // 2
    coarse = bake_density(field, views(scene), most)
    assert coarse.lattice.n_bricks <= most
    assert coarse.reduced_from == whole.lattice.resolution
    assert 10 < coarse.psnr_db < 60
    assert whole.psnr_db == 100


@pytest.mark.parametrize("name", ["Photographs", "style 1"])
def test_colors_with_too_many_bricks_are_made_coarser_and_say_what_that_costs(tiny, name):
    scene = tiny("ndc")
    field, of = scene.fields[name], views(scene)
    seen = seen_voxels(field, of)
    whole = bake_look("", field, of, SeenPoints(seen, MOST_BRICKS), RefitConfig())
    most = whole.lattice.n_bricks // 2
    coarse = bake_look("", field, of, SeenPoints(seen, most), RefitConfig())
    assert whole.reduced_from is None
    assert coarse.reduced_from == field.appearance.factors.resolution
    assert 0 < coarse.lattice.n_bricks <= most
    measured = baking_loss(field, of, appearance=coarse.appearance()).mean_db
    assert 10 < coarse.psnr_db == pytest.approx(measured, abs=0.01)


def test_what_a_camera_within_the_bounds_sees_has_colors(tiny, content):
    scene = tiny("ndc")
    field, of, lattice = scene.fields["style 1"], views(scene), content("ndc").looks[1].lattice
    radius = content("ndc").bounds.radius
    for k, camera in enumerate(scene.cameras[:5]):
        pose = camera.world_from_camera.copy()
        pose[:, 3] += 0.5 * radius * pose[:, k % 2]
        heavy, _ = heavy_samples(field, of, replace(camera, world_from_camera=pose))
        addresses, _ = corners(lattice, heavy.positions.numpy())
        assert (addresses >= 0).all(axis=1).mean() > 0.995
        own = lattice.needed.ravel()[addresses].all(axis=1)
        assert own[heavy.weights.detach().numpy() >= 0.1].mean() > 0.99


def test_a_field_with_a_density_of_its_own_is_refused(tiny):
    field = tiny("ndc").fields["Photographs"]
    other = deepcopy(field)
    require_shared_density("same", other, field)
    with torch.no_grad():
        other.density.factors.planes[0] += 1
    with rejects("style other"):
        require_shared_density("other", other, field)


def test_every_camera_is_within_the_bounds(tiny):
    cameras = tiny("unbounded").cameras
    bounds = camera_bounds(cameras, cameras[:2])
    centers = {tuple(center) for center, _ in bounds.guides}
    assert {tuple(camera.center_world) for camera in cameras} <= centers
    assert bounds.radius > 0
    assert np.linalg.norm(bounds.down) == pytest.approx(1)
    assert min(camera.world_from_camera[:, 1] @ bounds.down for camera in cameras) > 0.5


@pytest.mark.parametrize("tilt_rad", [0.0, 0.02, 0.7])
def test_the_camera_turns_about_an_axis_that_photographs_do_not_look_along(tilt_rad):
    """Over photographs that look straight down, it was the vertical, and the view was tilted."""
    cameras = []
    for k, heading in enumerate(np.pi * np.arange(6)):  # there and back again
        across = np.array([np.cos(heading), np.sin(heading), 0.0])
        ahead = np.array([0.0, 0.0, np.cos(tilt_rad)]) + np.sin(tilt_rad) * across
        right = np.cross(across, [0.0, 0.0, 1.0])
        pose = np.column_stack([right, np.cross(ahead, right), ahead, [0.1 * k, 0.0, 0.0]])
        cameras.append(Camera(f"{k}", 40, 30, 32.0, 32.0, 20.0, 15.0, pose))
    bounds = camera_bounds(cameras, cameras)
    assert np.linalg.norm(bounds.down) == pytest.approx(1)
    along = [abs(camera.forward_world @ bounds.down) for camera in cameras]
    assert max(along) < 0.9
