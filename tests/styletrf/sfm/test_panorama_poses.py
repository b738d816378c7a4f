"""Panoramas of the courtyard, through COLMAP, against where they were taken."""

from contextlib import closing, nullcontext
from dataclasses import replace

import numpy as np
import pycolmap
import pytest
from expected_errors import rejects
from made_panoramas import courtyard_panoramas
from made_photographs import encoded
from similarities import similarity

from styletrf.capture.capture_file import Photograph
from styletrf.capture.panorama.panorama_views import DIRECTIONS, panorama_from_view, view_camera
from styletrf.capture.scene_capture import capture_photographs
from styletrf.capture.views import held_out_names
from styletrf.geometry.camera_table import read_cameras, read_split
from styletrf.progress import silent
from styletrf.sfm.camera_poses import CameraPosesConfig, solve_camera_poses
from styletrf.sfm.colmap_features import extract_features
from styletrf.sfm.colmap_images import prepare_images
from styletrf.sfm.mapping import SfmResult, require_enough

COUNT, WIDTH = 5, 512


def captured(folder, images):
    (folder / "images").mkdir(parents=True)
    for index, image in enumerate(images):
        (folder / "images" / f"p{index}.png").write_bytes(encoded(image, ".png"))
    return capture_photographs(folder / "images", folder / "capture")


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """Panoramas of a walk, solved."""
    folder = tmp_path_factory.mktemp("panoramas")
    poses, images = courtyard_panoramas(COUNT, WIDTH)
    captured(folder, images)
    (folder / "poses").mkdir()
    config = CameraPosesConfig(max_features=1024)
    report = solve_camera_poses(folder / "capture", folder / "poses", config)
    return poses, folder / "poses" / "cameras.parquet", report


@pytest.mark.slow
def test_all_views_are_placed_where_their_panoramas_were_taken(solved):
    poses, table, report = solved
    assert (report.registered, report.total) == (5 * COUNT, 5 * COUNT)
    cameras = read_cameras(table)
    found = np.stack([camera.world_from_camera for camera in cameras])
    truth = np.stack([poses[int(camera.name[1])] for camera in cameras])
    turns = np.stack([panorama_from_view(camera.name.split("_")[1]) for camera in cameras])
    scale, rotation = similarity(found[:, :, 3], truth[:, :, 3])
    centers = scale * (found[:, :, 3] - found[:, :, 3].mean(axis=0)) @ rotation.T
    expected = truth[:, :, 3] - truth[:, :, 3].mean(axis=0)
    assert np.abs(centers - expected).max() < 0.002 * np.ptp(expected, axis=0).max()
    relative = rotation @ found[:, :, :3] @ (truth[:, :, :3] @ turns).transpose(0, 2, 1)
    cosines = (np.trace(relative, axis1=1, axis2=2) - 1) / 2
    assert np.degrees(np.arccos(np.clip(cosines, -1, 1))).max() < 0.1


@pytest.mark.slow
def test_views_of_a_panorama_share_its_center_and_keep_their_lens(solved):
    _, table, _ = solved
    cameras = read_cameras(table)
    lens = view_camera("front", WIDTH)
    for first in range(0, len(cameras), len(DIRECTIONS)):
        views = cameras[first : first + len(DIRECTIONS)]
        assert np.ptp([view.center_world for view in views], axis=0).max() < 1e-9
        for view in views:
            assert (view.fx, view.fy) == pytest.approx((lens.fx, lens.fx), rel=1e-12)
            assert (view.cx, view.cy) == (view.width / 2, view.height / 2)


@pytest.mark.parametrize(("placed", "enough"), [(2, False), (3, True)])
def test_views_of_a_panorama_count_as_one_where_too_few_are_placed(placed, enough):
    """Two panoramas passed as ten photographs."""
    options = pycolmap.SyntheticDatasetOptions(
        num_rigs=1, num_cameras_per_rig=len(DIRECTIONS), num_frames_per_rig=placed
    )
    mapping = SfmResult([pycolmap.synthesize_dataset(options)], "", 1, "", "", 1.0)
    photographs = [
        Photograph(f"p{k}_{direction}", "", 8, 8, 0, "", panorama=f"p{k}", direction=direction)
        for k in range(4)
        for direction in DIRECTIONS
    ]
    assert mapping.registered == placed * len(DIRECTIONS)
    refusal = nullcontext() if enough else rejects("the 4 photographs", placed)
    with refusal:
        require_enough(mapping, photographs)


@pytest.mark.parametrize(("panoramas", "held_out"), [(12, (0, 8)), (8, (4,))])
def test_views_of_a_panorama_count_as_one_where_some_are_held_out(panoramas, held_out):
    cameras = [
        replace(view_camera(direction, 64), name=f"{k}_{direction}")
        for k in range(panoramas)
        for direction in DIRECTIONS
    ]
    cameras.append(replace(cameras[0], name="photograph"))
    of_views = {camera.name: camera.name.split("_")[0] for camera in cameras[:-1]}
    names = held_out_names(cameras, {}, of_views)
    assert names == {f"{k}_{direction}" for k in held_out for direction in DIRECTIONS}


@pytest.mark.slow
def test_whole_panoramas_are_held_out(solved):
    _, table, _ = solved
    fitted, held_out = read_split(table)
    assert {view.name.split("_")[0] for view in held_out} == {f"p{COUNT // 2}"}
    assert len(held_out) == len(DIRECTIONS)
    assert len(fitted) == (COUNT - 1) * len(DIRECTIONS)


def prepared(folder, *, masked):
    """Returns a database of three panoramas and a photograph, and its images.

    Where it is masked, no view to the front is left of the first panorama.
    """
    _, images = courtyard_panoramas(COUNT, WIDTH)
    (folder / "masks").mkdir(parents=True)
    mask = np.full((256, 512, 3), 255, np.uint8)
    mask[:, 96:416] = 0
    if masked:
        (folder / "masks" / "p0.png").write_bytes(encoded(mask, ".png"))
    capture = captured(folder, [*images[:3], images[3][:, :320]])
    images = prepare_images(
        folder / "capture", capture, folder / "colmap" / "images", 1600, "auto", silent
    )
    database = folder / "colmap.db"
    extract_features(database, images, "SIMPLE_RADIAL", 16, silent)
    return database, images


@pytest.mark.parametrize("masked", [False, True])
def test_views_of_a_panorama_are_a_frame_and_photographs_frames_of_their_own(masked, tmp_path):
    database, images = prepared(tmp_path, masked=masked)
    with closing(pycolmap.Database.open(database)) as opened:
        names = {image.image_id: image.name for image in opened.read_all_images()}
        frames = [sorted(names[d.id] for d in f.data_ids) for f in opened.read_all_frames()]
        rigs = {rig.num_sensors() for rig in opened.read_all_rigs()}
        models = [str(camera.model_name) for camera in opened.read_all_cameras()]
    assert sorted(map(len, frames)) == [1, 4 if masked else 5, 5, 5]
    assert sorted(frames) == sorted([*map(list, images.panoramas), [images.files[-1]]])
    assert rigs == {1, 5}
    assert sorted(models) == ["SIMPLE_PINHOLE"] * 5 + ["SIMPLE_RADIAL"]
    assert not images.lenses_are_known


def test_cameras_of_a_rig_are_turned_as_the_views_are(tmp_path):
    database, images = prepared(tmp_path, masked=False)
    direction_of = {setting.files[0]: setting.direction for setting in images.lenses}
    with closing(pycolmap.Database.open(database)) as opened:
        directions = {
            image.camera_id: direction_of[image.name]
            for image in opened.read_all_images()
            if image.name in direction_of
        }
        (rig,) = (rig for rig in opened.read_all_rigs() if rig.num_sensors() > 1)
    first = panorama_from_view(directions[rig.ref_sensor_id.id])
    for sensor, pose in rig.non_ref_sensors.items():
        view_from_first = panorama_from_view(directions[sensor.id]).T @ first
        assert pose.rotation.matrix() == pytest.approx(view_from_first, abs=1e-12)
        assert pose.translation == pytest.approx(np.zeros(3))
