"""The formats in which a scene may already have its poses, beside its photographs.

    sparse/0, sparse/1 and so on                    COLMAP, binary or text
    transforms.json, or transforms_train.json and _test.json    instant-ngp, Blender
    poses_bounds.npy                                LLFF

Each has a reader of its own; all return the same structure.
"""

from pathlib import Path

from styletrf.capture.poses.colmap_model import read_colmap_model
from styletrf.capture.poses.given_poses import GivenPoses, GivenView
from styletrf.capture.poses.llff_poses import read_llff_folder
from styletrf.capture.poses.transforms_json import read_transforms
from styletrf.colmap import pycolmap
from styletrf.geometry.undistortion import pinhole_for

_READERS = (read_colmap_model, read_transforms, read_llff_folder)


def find_given_poses(folder: Path) -> GivenPoses | None:
    """Returns the poses that lie in the folder of a scene; of several formats the first above.

    Raises:
        InputError: The poses cannot be used, name photographs that are missing, or have a lens that
            no pinhole camera can replace.
    """
    given = next((given for read in _READERS if (given := read(folder))), None)
    for view in {view.lens: view for view in given.views}.values() if given else ():
        _require_pinhole(view)
    return given


def _require_pinhole(view: GivenView) -> None:
    """Refuses a lens whose photograph no pinhole camera replaces, before points are sought."""
    lens = view.lens
    if lens.width == lens.height == 1:  # of a photograph that cannot be read, and is left out
        return
    camera = pycolmap.Camera(
        model=lens.model, width=lens.width, height=lens.height, params=lens.params
    )
    pinhole_for(camera, view.file.name, view.world_from_camera)
