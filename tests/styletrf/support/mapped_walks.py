"""Walks along a street, and models of them."""

import numpy as np
import pycolmap

from styletrf.capture.capture_file import Photograph
from styletrf.progress import silent
from styletrf.sfm.colmap_images import ColmapImages
from styletrf.sfm.lens_settings import LensSetting
from styletrf.sfm.mapping_choice import MappingTask, reconstruct

PATH, OVERLAP, POINTS = 36, 3, 900


def world(count):
    """Points along a street, each with a descriptor of its own."""
    rng = np.random.default_rng(0)
    xyz = rng.uniform([-1, -1.5, 3], [PATH + 1.0, 1.5, 6], (count, 3))
    descriptors = np.abs(rng.normal(size=(count, 128)))
    descriptors *= 512 / np.linalg.norm(descriptors, axis=1, keepdims=True)
    return xyz, np.rint(descriptors).astype(np.uint8)


def rigged_lens(opened, focal_px):
    """Writes a lens and its rig to the database, and returns both."""
    lens = pycolmap.Camera(
        model="SIMPLE_RADIAL", width=200, height=150, params=[focal_px, 100.0, 75.0, 0.0]
    )
    lens.has_prior_focal_length = True
    lens.camera_id = opened.write_camera(lens)
    rig = pycolmap.Rig()
    rig.add_ref_sensor(lens.sensor_id)
    rig.rig_id = opened.write_rig(rig)
    return lens, rig


def walked(tmp_path, centers, focals_px=(150.0,), points=POINTS):
    """Returns a database of features as seen from `centers`, in that order, looking along z.

    The centers have the focal lengths in turn, equally many in a row with each.
    """
    database = tmp_path / "colmap.db"
    opened = pycolmap.Database.open(database)
    lenses = [rigged_lens(opened, focal_px) for focal_px in focals_px]
    xyz, descriptors = world(points)
    files = []
    for index, center in enumerate(centers):
        lens, rig = lenses[index * len(lenses) // len(centers)]
        pixels = lens.img_from_cam(xyz - center)
        seen = ((pixels > 0) & (pixels < [200, 150])).all(axis=1)
        files.append(f"{index:06d}.png")
        image = pycolmap.Image(name=files[-1], camera_id=lens.camera_id)
        image.image_id = opened.write_image(image)
        frame = pycolmap.Frame(rig_id=rig.rig_id)
        frame.add_data_id(image.data_id)
        opened.write_frame(frame)
        shapes = np.tile([1.0, 0.0], (seen.sum(), 1))  # scale and angle
        keypoints = np.concatenate([pixels[seen], shapes], axis=1)
        opened.write_keypoints(image.image_id, keypoints.astype(np.float32))
        described = pycolmap.FeatureDescriptors(
            data=descriptors[seen], type=pycolmap.FeatureExtractorType.SIFT
        )
        opened.write_descriptors(image.image_id, described)
    opened.close()
    each = len(files) // len(focals_px)
    settings = [
        LensSetting(tuple(files[k * each : (k + 1) * each]), focal_px)
        for k, focal_px in enumerate(focals_px)
    ]
    return database, ColmapImages(tmp_path, tuple(files), 200, tuple(settings))


def street(count):
    """Places along the street, not quite on one line."""
    along = np.arange(float(count))
    return np.column_stack([along, 0.3 * np.sin(2 * along), 0.3 * np.cos(3 * along)])


def mapped(database, images, photographs, exhaustive_up_to, preemptive_up_to=0):
    of = database, images, photographs
    return reconstruct(MappingTask(*of, exhaustive_up_to, preemptive_up_to, OVERLAP, 0, silent))


def named(names):
    return [Photograph(name, f"{name}.png", 200, 150, 1, "") for name in names]


def frames(count):
    return named([f"frame{index}" for index in range(count)])
