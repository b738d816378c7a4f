import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    "module",
    [
        "styletrf.colmap",
        "styletrf.sfm.camera_poses",
        "styletrf.sfm.colmap_features",
        "styletrf.sfm.colmap_images",
        "styletrf.sfm.colmap_mapping",
        "styletrf.sfm.mapping_choice",
        "styletrf.sfm.reconstruction",
    ],
)
def test_opencv_still_writes_png_after_pycolmap_is_loaded(module):
    """Two copies of zlib in one process, bound crosswise, would end it (see styletrf.colmap)."""
    code = (
        f"import {module}, cv2, numpy as np;"
        "image = np.random.default_rng(0).integers(0, 256, (99, 99, 3), dtype=np.uint8);"
        "assert (cv2.imdecode(cv2.imencode('.png', image)[1], 1) == image).all()"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
