"""A lens for each photograph, where nothing says that several share one."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path

from styletrf.colmap import pycolmap
from styletrf.sfm.colmap_images import ColmapImages
from styletrf.sfm.colmap_rigs import write_rigs
from styletrf.sfm.lens_settings import LensSetting


def with_own_lenses(images: ColmapImages) -> ColmapImages:
    """Returns the images with a lens setting for each photograph of a setting that is assumed."""
    settings: list[LensSetting] = []
    for setting in images.lenses:
        own = [LensSetting((file,), None) for file in setting.files]
        settings += own if setting.is_assumed else [setting]
    return replace(images, lenses=tuple(settings))


def give_own_lenses(database: Path, images: ColmapImages) -> None:
    """Gives the image of each lens setting of one image a camera of its own in the database.

    It begins as the one that the image shared.
    """
    alone = {setting.files[0] for setting in images.lenses if len(setting.files) == 1}
    with closing(pycolmap.Database.open(database)) as opened:
        opened.clear_frames()  # each names the camera of its image
        for image in opened.read_all_images():
            if image.name in alone:
                image.camera_id = opened.write_camera(opened.read_camera(image.camera_id))
                opened.update_image(image)
    write_rigs(database, images)
