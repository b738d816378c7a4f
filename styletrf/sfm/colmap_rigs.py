"""Ties the views of one panorama together: one center, known rotations between them.

For COLMAP these are the cameras of a rig, and each panorama is a frame of it: one pose to be found
instead of five.
"""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from styletrf.capture.panorama.panorama_views import panorama_from_view
from styletrf.colmap import pycolmap
from styletrf.sfm.colmap_images import ColmapImages


def write_rigs(database: Path, images: ColmapImages) -> None:
    """Replaces the rigs and frames of a database by those of its images.

    The views of each panorama are a frame. Panoramas of one size share a rig, whose first camera is
    the reference. Every other camera has a rig of its own, and every other image a frame.
    """
    with closing(pycolmap.Database.open(database)) as opened:
        image_of = {image.name: image for image in opened.read_all_images()}
        opened.clear_frames()
        opened.clear_rigs()
        rig_of: dict[int, int] = {}
        for cameras in _rigs(images, opened):
            rig_id = opened.write_rig(_rig(cameras))
            rig_of |= {camera.camera_id: rig_id for camera, _ in cameras}
        for files in _frames(images):
            views = [image_of[file] for file in files]
            frame = pycolmap.Frame(rig_id=rig_of[views[0].camera_id])
            for image in views:
                frame.add_data_id(image.data_id)
            opened.write_frame(frame)


def _rigs(
    images: ColmapImages, opened: pycolmap.Database
) -> list[list[tuple[pycolmap.Camera, str | None]]]:
    """Returns the cameras of each rig with their directions; all but views are rigs of one."""
    camera_ids = {image.name: image.camera_id for image in opened.read_all_images()}
    rigs: dict[object, list[tuple[pycolmap.Camera, str | None]]] = {}
    for setting in images.lenses:
        for camera_id in sorted({camera_ids[file] for file in setting.files}):
            camera = opened.read_camera(camera_id)
            key = ("views", camera.width) if setting.direction else camera_id
            rigs.setdefault(key, []).append((camera, setting.direction))
    return list(rigs.values())


def _rig(cameras: list[tuple[pycolmap.Camera, str | None]]) -> pycolmap.Rig:
    rig = pycolmap.Rig()
    (reference, first), *others = cameras
    rig.add_ref_sensor(reference.sensor_id)
    for camera, direction in others:
        if first is not None and direction is not None:
            view_from_first = panorama_from_view(direction).T @ panorama_from_view(first)
            pose = pycolmap.Rigid3d(pycolmap.Rotation3d(view_from_first), [0.0, 0.0, 0.0])
            rig.add_sensor(camera.sensor_id, pose)
    return rig


def _frames(images: ColmapImages) -> Iterator[tuple[str, ...]]:
    """Yields the files of each frame, in the order of the images."""
    panorama_of = {file: files for files in images.panoramas for file in files}
    for file in images.files:
        files = panorama_of.get(file, (file,))
        if files[0] == file:
            yield files
