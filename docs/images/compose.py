"""Composes the README's picture from `out/SCENE/*`: a frame, then each painting over its frame.

python docs/images/compose.py out/courtyard docs/images/courtyard.jpg
"""

import sys
from pathlib import Path

import cv2
import numpy as np

FRAME = 0.35  # which frame of the fly-through, as a share of it


def column(folder: Path) -> np.ndarray:
    """Returns the painting, as wide as the frame, above the stylized frame."""
    frames = sorted((folder / "frames").glob("*.png"))
    frame = cv2.imread(str(frames[int(FRAME * len(frames))]))
    style = cv2.imread(str(folder / "style.png"))
    height = round(style.shape[0] * frame.shape[1] / style.shape[1])
    style = cv2.resize(style, (frame.shape[1], height), interpolation=cv2.INTER_AREA)
    return np.concatenate([style[: frame.shape[0]], frame])


def unstylized(folder: Path) -> np.ndarray:
    """Returns the same frame before it was painted."""
    video = cv2.VideoCapture(str(folder / "unstylized.mp4"))
    count = int(video.get(cv2.CAP_PROP_FRAME_COUNT))
    video.set(cv2.CAP_PROP_POS_FRAMES, int(FRAME * count))
    frame = video.read()[1]
    return np.concatenate([np.full_like(frame, 255), frame])


def main() -> None:
    """Write the picture."""
    out, picture = Path(sys.argv[1]), sys.argv[2]
    folders = sorted(path for path in out.iterdir() if (path / "frames").is_dir())
    columns = [unstylized(folders[0]), *(column(folder) for folder in folders)]
    cv2.imwrite(picture, np.concatenate(columns, axis=1), [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    main()
