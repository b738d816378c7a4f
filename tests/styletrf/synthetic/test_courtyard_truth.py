"""The courtyard's ground truth holds the flow and the field's depth to account."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from surface_points import surface_points

from styletrf.evaluation.flow import FlowEstimator, agreement
from styletrf.field.kernels import kernels_for
from styletrf.field.rendering import RenderConfig, render_view
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.field_training import train_field
from styletrf.field.training.fit_inputs import FieldVolume, TrainingViews
from styletrf.field.view_rays import ViewRays
from styletrf.scene.scene_model import SceneModelConfig, decide_scene_model
from styletrf.synthetic.courtyard import (
    CourtyardConfig,
    capture_courtyard,
    courtyard_cameras,
    exact_flow,
)
from styletrf.synthetic.courtyard import render_view as photographed


def test_optical_flow_is_the_flow_of_the_surfaces():
    config = CourtyardConfig(width=240, height=180)
    a = courtyard_cameras(config)[0]
    pose = a.world_from_camera.copy()
    pose[:, 3] += 0.03 * pose[:, 0]  # three centimeters to the right, as between two frames
    b = replace(a, world_from_camera=pose)
    (image_a, depth_a), (image_b, depth_b) = (photographed(camera, config) for camera in (a, b))
    exact, visible = exact_flow(a, depth_a, b, depth_b)
    frames = [(image / 255).astype(np.float32) for image in (image_a, image_b)]
    estimated = FlowEstimator()
    there, back = estimated(*frames), estimated(*reversed(frames))
    error = np.linalg.norm(there - exact, axis=-1)
    seen = visible & np.isfinite(depth_a)
    assert np.linalg.norm(exact, axis=-1)[seen].mean() > 0.5, "the views do differ"
    assert np.median(error[seen]) < 0.3
    assert error[seen & agreement(there, back)].mean() < error[~visible].mean()


@pytest.mark.slow
def test_depth_of_a_field_is_that_of_the_surfaces():
    """Fitted to all views but one, with the exact cameras; Z of that one against the truth."""
    capture = capture_courtyard(CourtyardConfig(n_views=10, width=64, height=48))
    points = np.concatenate(
        [surface_points(c, d) for c, d in zip(capture.cameras, capture.depths, strict=True)]
    )
    model = decide_scene_model(
        capture.cameras, points[::43], SceneModelConfig(image_long_side=64, max_voxels=64**3)
    )
    cameras, cpu = model.normalized(capture.cameras), torch.device("cpu")
    images = torch.from_numpy(np.stack(capture.images))
    config = FieldTrainingConfig(iterations=200, batch=1024, upsample_at=(0.2, 0.4, 0.6))
    kernels, volume = kernels_for(cpu), FieldVolume(model.space, model.resolution)
    field, _ = train_field(TrainingViews(cameras[1:], images[1:]), volume, config, kernels)
    rays = ViewRays(cameras[:1], model.space, field.step_length, cpu)
    render = render_view(field, kernels, rays, 0, cameras[0], RenderConfig())
    meters = np.linalg.norm(model.normalized_from_world[:3, 0])
    truth = capture.depths[0]
    surface = np.isfinite(truth)
    error = np.abs(render.surface_depth.numpy()[surface] / meters / truth[surface] - 1)
    assert np.median(error) < 0.08  # of a fit of seconds; a wrong convention is off by far more
    assert render.opacity.numpy()[surface].mean() > 0.95
