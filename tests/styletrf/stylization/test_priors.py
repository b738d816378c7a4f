"""Priors: which viewpoints are painted."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from mini_scene import fitted_plane, painted_plane

from styletrf.field.rendering import RenderConfig
from styletrf.stylization.priors import PriorsConfig, needed_views, views_along
from styletrf.trajectory.coverage import CoverageConfig, places_seen, shown
from styletrf.trajectory.frames import rendered, write_float_frames
from styletrf.trajectory.trajectories import fly_through, prior_views
from styletrf.trajectory.trajectory_config import TrajectoryConfig

CPU = torch.device("cpu")


@pytest.mark.parametrize("count", [1, 3, 7, 20])
def test_views_along_a_path_are_cameras_of_it_in_order_from_end_to_end(count):
    cameras = painted_plane(7).cameras
    views = views_along(cameras, cameras[0], count)
    places = [next(k for k, c in enumerate(cameras) if c.name == view.name) for view in views]
    assert len(views) == min(count, 7)
    assert places == sorted(set(places))
    assert places[0] == 0
    assert count == 1 or places[-1] == 6


def test_views_along_a_path_have_the_size_that_is_asked_for():
    cameras = painted_plane(3).cameras
    size = replace(cameras[0], width=12, height=9)
    assert {(view.width, view.height) for view in views_along(cameras, size, 3)} == {(12, 9)}


def test_priors_on_the_path_stand_where_its_cameras_do(tmp_path):
    scene = painted_plane()
    field, config = fitted_plane(), TrajectoryConfig(frames=8)
    path = fly_through(scene.cameras, scene.model, config)
    write_float_frames(
        tmp_path, path, rendered(field, scene.model.space, path, RenderConfig(), CPU)
    )
    candidates = prior_views(scene.cameras, scene.model, config)
    own = {camera.center_world.tobytes() for camera in path}

    def standing_on_the_path(viewpoints):
        priors = PriorsConfig(
            viewpoints=viewpoints,
            trajectory=TrajectoryConfig(frames=4),
            coverage=CoverageConfig(count=4),
        )
        views = needed_views(candidates, tmp_path, field, scene.model.space, priors, CPU)
        assert len(views) == 4
        return sum(view.center_world.tobytes() in own for view in views)

    assert standing_on_the_path("path") == 4
    assert standing_on_the_path("spread") < 4


def test_nearly_every_place_of_a_path_is_in_a_prior_although_it_leaves_the_candidates(tmp_path):
    """The demo had a strip at the edge of its frames that no prior showed."""
    scene = painted_plane()
    field = fitted_plane()
    path = fly_through(scene.cameras, scene.model, TrajectoryConfig(frames=8, spread=1.2))
    renders = list(rendered(field, scene.model.space, path, RenderConfig(), CPU))
    write_float_frames(tmp_path, path, iter(renders))
    candidates = prior_views(scene.cameras, scene.model, TrajectoryConfig(frames=6, spread=0.6))

    def fraction_in_a_prior(once):
        coverage = CoverageConfig(times=1, share=0.9, once=once, most_hidden=0.1)
        config = PriorsConfig(coverage=coverage)
        views = needed_views(candidates, tmp_path, field, scene.model.space, config, CPU)
        places = places_seen(path, [render.depth.numpy() for render in renders])
        depths = rendered(field, scene.model.space, views, RenderConfig(), CPU)
        return np.any(
            [
                shown(view, render.depth.numpy(), places, coverage.tolerance, 1)
                for view, render in zip(views, depths, strict=True)
            ],
            axis=0,
        ).mean()

    assert fraction_in_a_prior(0.0) < 0.98
    assert fraction_in_a_prior(0.998) > 0.995
