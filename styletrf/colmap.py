"""pycolmap, loaded so that it leaves OpenCV alone: `from styletrf.colmap import pycolmap`.

pycolmap carries a zlib of its own, and a system's zlib that is first loaded together with it gets
bound to that copy: OpenCV's PNG writer, which uses the system's, then ends the process. With zlib
loaded before, both are left alone.
"""

import zlib  # noqa: F401

import pycolmap

__all__ = ["pycolmap"]
