"""Composes the README's picture from `out/SCENE`: paintings, and frames in the style of each.

python docs/images/compose.py out/courtyard out/orbit docs/images/courtyard.jpg

The first row has the paintings; a row for each scene has an unstylized frame, then the same frame
in the style of each painting.
"""

import sys
from pathlib import Path

import cv2
import numpy as np

FRAME = 0.35  # which frame of the fly-through, as a share of it
WIDTH_PX = 400  # of a frame


def at_width(image: np.ndarray) -> np.ndarray:
    """Returns the image at the width of a frame."""
    size = WIDTH_PX, round(image.shape[0] * WIDTH_PX / image.shape[1])
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def paintings(folders: list[Path], height: int) -> np.ndarray:
    """Returns the paintings side by side, to the right of an empty frame."""
    images = [at_width(cv2.imread(str(folder / "style.png"))) for folder in folders]
    height = min(height, *(len(image) for image in images))
    empty = np.full((height, WIDTH_PX, 3), 255, np.uint8)
    return np.concatenate([empty, *(image[:height] for image in images)], axis=1)


def frames(folders: list[Path]) -> np.ndarray:
    """Returns a frame before it was painted, then in the style of each painting."""
    video = cv2.VideoCapture(str(folders[0] / "unstylized.mp4"))
    count = int(video.get(cv2.CAP_PROP_FRAME_COUNT))
    video.set(cv2.CAP_PROP_POS_FRAMES, int(FRAME * count))
    painted = (sorted((folder / "frames").glob("*.png")) for folder in folders)
    images = [video.read()[1], *(cv2.imread(str(of[int(FRAME * len(of))])) for of in painted)]
    return np.concatenate([at_width(image) for image in images], axis=1)


def main() -> None:
    """Write the picture."""
    *scenes, picture = sys.argv[1:]
    styled = [
        sorted(path for path in Path(scene).iterdir() if (path / "frames").is_dir())
        for scene in scenes
    ]
    rows = [frames(folders) for folders in styled]
    rows.insert(0, paintings(styled[0], len(rows[0])))
    cv2.imwrite(picture, np.concatenate(rows), [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    main()
