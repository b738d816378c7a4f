"""Reads from the artifacts of the stages all that a viewer shows of a scene besides its fields."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from styletrf.files.video_frames import video_info
from styletrf.geometry.camera_table import read_cameras
from styletrf.geometry.cameras import Camera
from styletrf.reports.embedding import embedded_image
from styletrf.scene.scene_model import SceneModel, read_scene_model

THUMBNAIL_PX = 192


@dataclass(frozen=True, slots=True)
class ViewedScene:
    """Cameras, the model, and a photograph.

    Attributes:
        model: The model of the scene.
        photographed: The photographs' cameras, in the normalized world.
        path: The fly-through, in the normalized world.
        frames_per_second: The rate of the fly-through.
        thumbnail: The photograph in the middle of all, as a `data:` URI.
    """

    model: SceneModel
    photographed: Sequence[Camera]
    path: Sequence[Camera]
    frames_per_second: float
    thumbnail: str


def read_viewed_scene(inputs: Mapping[str, Path]) -> ViewedScene:
    """Returns the scene in the artifacts `model`, `poses` and `trajectory`."""
    model = read_scene_model(inputs["model"] / "scene.json")
    photographs = read_cameras(inputs["poses"] / "cameras.parquet")
    path = read_cameras(inputs["trajectory"] / "cameras.parquet")
    rate = float(video_info(inputs["trajectory"] / "video.mp4").frames_per_second)
    middle = inputs["poses"] / "images" / f"{photographs[len(photographs) // 2].name}.png"
    return ViewedScene(model, model.normalized(photographs), path, rate, thumbnail(middle))


def thumbnail(image: Path) -> str:
    """Returns an image as a small one in a `data:` URI."""
    return embedded_image(image, THUMBNAIL_PX)
