import numpy as np
import pycolmap
import pytest

from styletrf.sfm.colmap_images import ColmapImages
from styletrf.sfm.colmap_mapping import map_globally, map_incrementally, match_pairs
from styletrf.sfm.lens_settings import LensSetting
from styletrf.sfm.matching.image_pairs import all_pairs

TOTAL = 8


@pytest.fixture
def synthetic(tmp_path):
    """A database of noiseless matches among 8 cameras, and the truth behind it."""
    database = tmp_path / "colmap.db"
    options = pycolmap.SyntheticDatasetOptions(
        num_rigs=1, num_cameras_per_rig=1, num_frames_per_rig=TOTAL, num_points3D=200
    )
    pycolmap.set_random_seed(1)
    opened = pycolmap.Database.open(database)
    truth = pycolmap.synthesize_dataset(options, opened)
    opened.close()
    files = tuple(sorted(image.name for image in truth.images.values()))
    return database, ColmapImages(tmp_path, files, 0, (LensSetting(files, None),)), truth


@pytest.mark.parametrize("mapper", [map_globally, map_incrementally])
def test_both_mappers_find_the_cameras_of_perfect_matches(synthetic, mapper):
    database, images, truth = synthetic
    calls = []
    (model,) = mapper(database, images, 0, lambda done, total: calls.append((done, total)))
    assert model.num_reg_images() == TOTAL
    errors = pycolmap.compare_reconstructions(model, truth, alignment_error="proj_center")["errors"]
    assert max(error.rotation_error_deg for error in errors) < 0.1
    assert calls[-1] == (TOTAL, TOTAL)
    assert all(0 <= done <= total == TOTAL for done, total in calls)


def test_matching_reports_its_progress_in_pairs(tmp_path):
    database, files = tmp_path / "colmap.db", [f"{i}.png" for i in range(20)]
    with_features(database, files)
    calls, pairs = [], all_pairs(20)
    images = ColmapImages(tmp_path, tuple(files), 64, (LensSetting(tuple(files), None),))
    verified = match_pairs(database, images, pairs, 0, lambda *call: calls.append(call))
    assert verified == 0  # noise matches nothing
    done = [done for done, total in calls if total == len(pairs)]
    phases = np.split(done, np.flatnonzero(np.diff(done) < 0) + 1)
    assert len(phases) == 2, "pairs are matched, then verified"
    for phase in phases:
        assert phase[0] == 0
        assert phase[-1] == len(pairs)


def with_features(database, files):
    rng = np.random.default_rng(0)
    opened = pycolmap.Database.open(database)
    camera = pycolmap.Camera(model="SIMPLE_RADIAL", width=64, height=64, params=[70, 32, 32, 0])
    camera.camera_id = opened.write_camera(camera)
    rig = pycolmap.Rig()
    rig.add_ref_sensor(camera.sensor_id)
    rig.rig_id = opened.write_rig(rig)
    for file in files:
        image = pycolmap.Image(name=file, camera_id=camera.camera_id)
        image_id = opened.write_image(image)
        opened.write_keypoints(image_id, rng.random((30, 2)).astype(np.float32) * 64)
        data = np.abs(rng.normal(size=(30, 128)))
        data = np.rint(512 * data / np.linalg.norm(data, axis=1, keepdims=True)).astype(np.uint8)
        kind = pycolmap.FeatureExtractorType.SIFT
        opened.write_descriptors(image_id, pycolmap.FeatureDescriptors(data=data, type=kind))
    opened.close()
