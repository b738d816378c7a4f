"""Images, cameras and features in a COLMAP database."""

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import cv2
import numpy as np

from styletrf.colmap import pycolmap
from styletrf.progress import Progress
from styletrf.sfm.colmap_images import ColmapImages
from styletrf.sfm.colmap_rigs import write_rigs
from styletrf.sfm.lens_settings import LensSetting
from styletrf.sfm.matching.sift_features import Descriptors, Features, Gray, sift_features

_WORKERS = 4  # of which each needs some 250 bytes a pixel


def extract_features(
    database: Path, images: ColmapImages, camera_model: str, max_features: int, progress: Progress
) -> None:
    """Fills the database with the images, a camera for each lens setting, and SIFT features.

    A camera starts from its setting's focal prior, or from COLMAP's guess where there is none. The
    largest features of an image are kept, where it shows more than `max_features`.
    """
    _register(database, images, camera_model)
    with closing(pycolmap.Database.open(database)) as opened:
        ids = image_ids(opened, images)
        kind, total = pycolmap.FeatureExtractorType.SIFT, len(images.files)
        progress(0, total)
        for done, features in enumerate(_described(images, max_features)):
            opened.write_keypoints(ids[done], features.keypoints)
            described = pycolmap.FeatureDescriptors(data=features.descriptors, type=kind)
            opened.write_descriptors(ids[done], described)
            progress(done + 1, total)


def extract_stronger_features(
    database: Path, images: ColmapImages, camera_model: str, max_features: int, progress: Progress
) -> None:
    """Fills the database as `extract_features` does, with COLMAP's own features.

    These take many times as long: they are twice as many, with fainter ones, their shape estimated
    up to an affinity and described at several sizes (Dong and Soatto 2015).
    """
    options = pycolmap.FeatureExtractionOptions(use_gpu=False)
    options.sift.max_num_features = 2 * max_features
    options.sift.peak_threshold /= 2
    options.sift.estimate_affine_shape = options.sift.domain_size_pooling = True
    _register(database, images, camera_model)
    portion, total = 2 * (os.cpu_count() or 1), len(images.files)
    masked = [file for file in images.files if images.mask_of(file)]
    others = [file for file in images.files if not images.mask_of(file)]
    done = 0
    for files, reader in ((masked, _reader(images.masks)), (others, _reader(None))):
        for start in range(0, len(files), portion):
            progress(done, total)
            some = files[start : start + portion]
            pycolmap.extract_features(
                database,
                images.folder,
                some,
                reader_options=reader,
                extraction_options=options,
                device=pycolmap.Device.cpu,
            )
            done += len(some)
    progress(total, total)


def _reader(masks: Path | None) -> pycolmap.ImageReaderOptions:
    """Returns how COLMAP reads images; with masks, it leaves out the images that have none."""
    reader = pycolmap.ImageReaderOptions()
    if masks is not None:
        reader.mask_path = masks
    return reader


def image_ids(opened: pycolmap.Database, images: ColmapImages) -> list[int]:
    """Returns COLMAP's number of each image."""
    of = {image.name: image.image_id for image in opened.read_all_images()}
    return [of[file] for file in images.files]


def read_descriptors(opened: pycolmap.Database, image_id: int) -> Descriptors:
    """Returns the SIFT descriptors of an image, in the order of its keypoints."""
    return np.asarray(opened.read_descriptors(image_id).data)


def read_largest_descriptors(opened: pycolmap.Database, image_id: int, count: int) -> Descriptors:
    """Returns the descriptors of the largest features of an image, `count` at most."""
    keypoints = np.asarray(opened.read_keypoints(image_id))
    if not len(keypoints):
        return np.empty((0, 128), np.uint8)
    if keypoints.shape[1] == 6:  # x, y, and the four numbers of an affinity
        areas = np.abs(keypoints[:, 2] * keypoints[:, 5] - keypoints[:, 3] * keypoints[:, 4])
    else:
        areas = keypoints[:, 2] ** 2
    largest = np.argsort(-areas, kind="stable")[:count]
    return read_descriptors(opened, image_id)[largest]


def _described(images: ColmapImages, max_features: int) -> Iterator[Features]:
    def described(file: str) -> Features:
        mask = images.mask_of(file)
        counts = None if mask is None else (_read_gray(mask) > 127).astype(np.uint8)
        return sift_features(_read_gray(images.folder / file), max_features, counts)

    with ThreadPoolExecutor(min(_WORKERS, os.cpu_count() or 1)) as pool:
        yield from pool.map(described, images.files)


def _read_gray(path: Path) -> Gray:
    """Returns the levels in [0, 255] of a PNG that this program wrote, unchecked for damage."""
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise OSError(f"{path} is no image")
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))


def _register(database: Path, images: ColmapImages, camera_model: str) -> None:
    """Gives images and cameras their numbers, in order, ties views, and sets focal priors.

    The threads in which COLMAP describes images would number them as they come, and later choices
    (which matches RANSAC samples first, which pair begins) would differ from run to run.
    """
    pycolmap.Database.open(database).close()
    modes, settings = pycolmap.CameraMode, images.lenses
    each = all(len(setting.files) == 1 and setting.direction is None for setting in settings)
    mode = modes.PER_IMAGE if each else modes.SINGLE
    for setting in [LensSetting(images.files, None)] if each else settings:
        model = camera_model if setting.direction is None else "SIMPLE_PINHOLE"
        reader = pycolmap.ImageReaderOptions(camera_model=model)
        pycolmap.import_images(database, images.folder, mode, list(setting.files), reader)
    if images.panoramas:
        write_rigs(database, images)
    for setting in settings:
        if setting.focal_prior_px is not None:
            _set_focal(database, setting.files[0], setting.focal_prior_px)


def _set_focal(database: Path, file: str, focal_px: float) -> None:
    """Sets the known focal length of the camera that took an image."""
    with closing(pycolmap.Database.open(database)) as opened:
        image = next(image for image in opened.read_all_images() if image.name == file)
        camera = opened.read_camera(image.camera_id)
        params = list(camera.params)
        for index in camera.focal_length_idxs():
            params[index] = focal_px
        camera.params = params
        camera.has_prior_focal_length = True
        opened.update_camera(camera)
