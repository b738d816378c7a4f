import re
import subprocess
import sys
from pathlib import Path

STYLETRF = Path(__file__).parents[2] / "styletrf"


def test_opencv_still_writes_png_after_pycolmap_is_loaded():
    """Two copies of zlib in one process, bound crosswise, would end it (see styletrf.colmap)."""
    code = (
        "import styletrf.colmap, cv2, numpy as np;"
        "image = np.random.default_rng(0).integers(0, 256, (99, 99, 3), dtype=np.uint8);"
        "assert (cv2.imdecode(cv2.imencode('.png', image)[1], 1) == image).all()"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_all_load_pycolmap_through_one_module():
    loading = re.compile(r"^\s*(?:import|from) pycolmap\b", re.MULTILINE)
    files = (path for path in STYLETRF.rglob("*.py") if loading.search(path.read_text("utf-8")))
    assert [path.relative_to(STYLETRF).as_posix() for path in files] == ["colmap.py"]
