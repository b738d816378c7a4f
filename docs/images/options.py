"""Makes the picture of `docs/style.md`: one frame of the courtyard under every option.

python docs/images/options.py docs/images/options.jpg

Settings are those of `make demo`, whose stages are found again; a tile bears the words of its
command. Only the frame that is shown is rendered.
"""

import json
import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import luigi
import numpy as np

from pipeline.task import artifact
from styletrf.geometry.camera_table import read_cameras
from styletrf.steps.stylized_frames import Blend, stylized_frames
from styletrf.trajectory.frames import write_pictures
from tasks.stages.stylization import StylizedFrames

STYLE = "brush"
COLUMNS = 4
FRAME = 0.35  # which frame of the fly-through, as a share of it
OPTIONS: tuple[dict[str, Any], ...] = (
    {},
    {"strength": 0.5},
    {"blend": {"dots": 0.5}},
    {"region": {"box": [[-99, -99, -99], [0, 99, 99]]}},
    {"colors": "photograph"},
    {"colors": "luminance"},
    {"stroke_scale": 2.0},
    {"content_weight": 3.0},
    {"match": "pixels"},
    {"match": "gram"},
    {"strategy": "s2"},
    {"strategy": "s1"},
    {"rounds": 2},
    {"stylizer": "arbitrary"},
    {"stylizer": "gatys"},
    {"method": "per-frame"},
)


def demo_settings() -> dict[str, Any]:
    """Returns the settings of `make demo`, as the Makefile has them, by stage."""
    text = Path(__file__).parents[2].joinpath("Makefile").read_text()
    (found,) = re.findall(r"DEMO_TUNING = (\{.*?\}\})\n", text, re.DOTALL)
    settings: dict[str, Any] = json.loads(found.replace("\\\n", ""))
    return settings


def frame_under(words: dict[str, Any]) -> np.ndarray:
    """Returns the frame as 8-bit BGR."""
    task = StylizedFrames(
        scene="courtyard", style=STYLE, quality="draft", tuning=demo_settings(), **words
    )
    if not luigi.build([*task.requires().values()], local_scheduler=True, log_level="WARNING"):
        raise SystemExit(f"a stage failed under {words}")
    inputs = {name: artifact(stage) for name, stage in task.requires().items()}
    cameras = read_cameras(inputs["trajectory"] / "cameras.parquet")
    camera = cameras[int(FRAME * len(cameras))]
    with TemporaryDirectory() as folder:
        blend = Blend(task.strength, task.blend, task.region)
        frames = stylized_frames(inputs, [camera], task.values(), blend, task.device)
        write_pictures(Path(folder), [camera.name], frames)
        return cv2.imread(str(Path(folder, "frames", f"{camera.name}.png")))


def tile(words: dict[str, Any]) -> np.ndarray:
    """Returns the frame below the words of its command."""
    frame = frame_under(words)
    title = np.full((24, frame.shape[1], 3), 255, np.uint8)
    font, black = cv2.FONT_HERSHEY_SIMPLEX, (0, 0, 0)
    cv2.putText(title, title_of(words), (4, 17), font, 0.42, black, 1, cv2.LINE_AA)
    return np.concatenate([title, frame])


def title_of(words: dict[str, Any]) -> str:
    """Returns the words of the command, a region in short."""
    if not words:
        return "without options"
    ((name, value),) = words.items()
    if name == "region":
        value = "{box: the left half}"
    return f"--{name.replace('_', '-')} {str(value).replace(chr(39), '')}"


def main() -> None:
    """Write the picture."""
    tiles = [tile(words) for words in OPTIONS]
    tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % COLUMNS)
    rows = [np.concatenate(tiles[k : k + COLUMNS], 1) for k in range(0, len(tiles), COLUMNS)]
    cv2.imwrite(sys.argv[1], np.concatenate(rows), [cv2.IMWRITE_JPEG_QUALITY, 85])


if __name__ == "__main__":
    main()
