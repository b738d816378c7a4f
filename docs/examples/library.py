"""A stylized fly-through of a small synthetic scene by the library alone, without Luigi.

python docs/examples/library.py OUT
"""

import copy
import sys
from pathlib import Path

import numpy as np
import torch

from styletrf.field.field_config import FieldConfig
from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import RadianceField, refine_appearance
from styletrf.field.rendering import RenderConfig
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.field_training import train_field
from styletrf.field.training.fit_inputs import FieldVolume, TrainingViews
from styletrf.files.images import to_integers
from styletrf.geometry.cameras import Camera, pixel_centers, points_at_depth
from styletrf.scene.scene_model import SceneModel, SceneModelConfig, decide_scene_model
from styletrf.stylization.adaptation import AdaptationConfig, adapt_appearance
from styletrf.stylization.color_transfer import in_colors
from styletrf.synthetic.courtyard import Capture, CourtyardConfig, capture_courtyard
from styletrf.synthetic.paintings import stained_glass
from styletrf.trajectory.frames import rendered, write_clip
from styletrf.trajectory.trajectories import fly_through
from styletrf.trajectory.trajectory_config import TrajectoryConfig

LONG_SIDE_PX = 64
DEVICE = torch.device("cpu")
FIT = FieldTrainingConfig(
    field=FieldConfig(density_ranks=(8,), appearance_ranks=(8,), features=8, hidden=16),
    iterations=150,
    batch=512,
    initial_voxels=24**3,
    batch_samples=16000,
)
ADAPTATION = AdaptationConfig(iterations=60, batch=1024)


def sparse_points_world(capture: Capture, count: int = 2000) -> np.ndarray:
    """Returns surface points, as COLMAP would from photographs; see `styletrf.sfm`."""
    rng = np.random.default_rng(0)
    points = []
    for camera, depth in zip(capture.cameras, capture.depths, strict=True):
        pixels, flat = pixel_centers(camera.width, camera.height), depth.reshape(-1)
        chosen = rng.choice(np.flatnonzero(np.isfinite(flat)), count // len(capture.cameras))
        points.append(points_at_depth(camera, pixels[chosen], flat[chosen].astype(np.float64)))
    return np.concatenate(points)


def fit(capture: Capture) -> tuple[SceneModel, list[Camera], RadianceField]:
    """Returns the scene model, the cameras in its normalized world, and the fitted field."""
    config = SceneModelConfig(image_long_side=LONG_SIDE_PX, max_voxels=48**3)
    model = decide_scene_model(capture.cameras, sparse_points_world(capture), config)
    cameras = model.normalized(capture.cameras)
    views = TrainingViews(cameras, torch.from_numpy(np.stack(capture.images)))
    volume = FieldVolume(model.space, model.resolution)
    field, curve = train_field(views, volume, FIT, kernels_for(DEVICE))
    sys.stdout.write(f"space {model.space.kind}, training PSNR {curve[-1].psnr:.1f} dB\n")
    return model, cameras, field


def render(field: RadianceField, model: SceneModel, cameras: list[Camera]) -> list[np.ndarray]:
    """Returns the renders of a field, float RGB in [0, 1]."""
    views = rendered(field, model.space, cameras, RenderConfig(), DEVICE)
    return [view.color.numpy() for view in views]


def stylize(field: RadianceField, model: SceneModel, cameras: list[Camera]) -> RadianceField:
    """Returns the field with its appearance adapted to stylized renders; the density stays.

    The stylizer here is a color transfer. A style network is `network_painter` in
    `styletrf.stylization.painters`.
    """
    stylized = copy.deepcopy(field)
    priors = cameras[::2]
    plain = render(field, model, priors)
    painting = stained_glass(0).astype(np.float32) / 255
    views = in_colors(plain, plain, painting, "style")
    refine_appearance(stylized, 1.0, "plain", torch.Generator().manual_seed(0))
    adapt_appearance(
        stylized,
        priors,
        torch.from_numpy(np.stack([to_integers(view) for view in views])),
        model.space,
        ADAPTATION,
        kernels_for(DEVICE),
    )
    return stylized


def main(out: Path) -> None:
    """Writes `unstylized.mp4` and `stylized.mp4` into the folder `out`."""
    size = CourtyardConfig(n_views=10, width=LONG_SIDE_PX, height=48)
    model, cameras, field = fit(capture_courtyard(size))
    path = fly_through(cameras, model, TrajectoryConfig(frames=12))
    out.mkdir(parents=True, exist_ok=True)
    for name, shown in (("unstylized", field), ("stylized", stylize(field, model, cameras))):
        write_clip(out / f"{name}.mp4", iter(render(shown, model, path)), 12)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
