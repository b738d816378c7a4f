"""Composes a picture of one frame under several options: NAME=FOLDER of `out/`, three in a row.

python docs/images/options.py options.jpg "none=out/courtyard/dots" "--strategy s1=/kept"
"""

import sys
from pathlib import Path

import cv2
import numpy as np

FRAME = 0.35  # which frame of the fly-through, as a share of it


def tile(told: str) -> np.ndarray:
    """Returns the frame below its name."""
    name, _, folder = told.rpartition("=")
    frames = sorted((Path(folder) / "frames").glob("*.png"))
    frame = cv2.imread(str(frames[int(FRAME * len(frames))]))
    title = np.full((24, frame.shape[1], 3), 255, np.uint8)
    cv2.putText(title, name, (4, 17), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
    return np.concatenate([title, frame])


def main() -> None:
    """Write the picture."""
    tiles = [tile(told) for told in sys.argv[2:]]
    tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % 3)
    rows = [np.concatenate(tiles[k : k + 3], axis=1) for k in range(0, len(tiles), 3)]
    cv2.imwrite(sys.argv[1], np.concatenate(rows), [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    main()
