import ast
import subprocess
import sys
from pathlib import Path

from source_names import modules_imported, syntax_of

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
    loading = [
        path.relative_to(STYLETRF).as_posix()
        for path in STYLETRF.rglob("*.py")
        if "pycolmap" in {n.partition(".")[0] for n in modules_imported(ast.walk(syntax_of(path)))}
    ]
    assert loading == ["colmap.py"]
