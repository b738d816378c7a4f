"""Pairs of renders with the exact flow between them: a color of the scene stays where it is."""

import numpy as np
import pytest
import torch
from expected_errors import rejects
from hypothesis import given
from hypothesis import strategies as st

from styletrf.evaluation.consistency.frame_pairs import planned_pairs
from styletrf.evaluation.consistency.pair_plan import PairPlan
from styletrf.field.rendering import Rendering
from styletrf.geometry.cameras import Camera
from styletrf.style.training.render_pairs import RenderPairs, training_pairs
from styletrf.style.training.temporal_loss import temporal_loss
from styletrf.trajectory.frames import write_float_frames

WIDTH, HEIGHT = 40, 32


def wall(x: float) -> tuple[Camera, Rendering]:
    """A camera at x, y = 0 that looks straight at a colored wall at depth 4."""
    pose = np.column_stack([np.eye(3), [x, 0.0, 0.0]])
    camera = Camera(f"{x:.1f}", WIDTH, HEIGHT, 40.0, 40.0, 20.0, 16.0, pose)
    columns = (torch.arange(WIDTH) + 0.5 - 20) / 40 * 4 + x
    rows = (torch.arange(HEIGHT) + 0.5 - 16) / 40 * 4
    grid = torch.stack(torch.meshgrid(rows, columns, indexing="ij"), dim=-1)
    color = 0.5 + 0.4 * torch.sin(torch.stack([grid[..., 0], grid[..., 1], grid.sum(-1)], dim=-1))
    ones = torch.ones(HEIGHT, WIDTH)
    return camera, Rendering(color, ones, 4 * ones, 4 * ones)


@pytest.fixture
def folder(tmp_path):
    cameras, renders = zip(*(wall(0.1 * k) for k in range(7)), strict=True)
    write_float_frames(tmp_path, cameras, iter(renders))
    return tmp_path


@pytest.mark.parametrize("k", range(4))
def test_what_the_scene_shows_is_steady(folder, k):
    pair = RenderPairs(folder, batch=2, crop_px=24, seed=0)(k)
    assert pair.first.shape == pair.second.shape == (2, 3, 24, 24)
    assert pair.valid.float().mean() > 0.3
    steady = temporal_loss(pair.first, pair.second, pair)
    assert steady < 2e-3
    turned = torch.rot90(pair.first, dims=(2, 3))
    assert temporal_loss(turned, torch.rot90(pair.second, dims=(2, 3)), pair) > 2 * steady


def test_a_pair_depends_on_its_number_alone(folder):
    pairs = [RenderPairs(folder, batch=1, crop_px=99, seed=0) for _ in "ab"]
    first = pairs[0](3)
    pairs[1](0)
    assert torch.equal(first.first, pairs[1](3).first)
    assert first.first.shape[-1] == HEIGHT, "no larger than the renders"


def test_one_render_has_no_pair(tmp_path):
    camera, render = wall(0.0)
    write_float_frames(tmp_path, [camera], iter([render]))
    with rejects(tmp_path):
        RenderPairs(tmp_path, batch=1, crop_px=16, seed=0)


@given(
    st.integers(2, 90),
    st.lists(st.integers(1, 9), min_size=1, max_size=4),
    st.integers(1, 99),
    st.lists(st.integers(1, 89), max_size=3),
)
def test_no_pair_is_trained_on_and_measured(n_renders, deltas, pairs, cuts):
    plan = PairPlan(deltas=tuple(deltas), pairs=pairs)
    measured = {(p.first, p.second) for p in planned_pairs(n_renders, plan, cuts)}
    found = training_pairs(n_renders, measured)
    trained = {(k, k + apart) for apart, firsts in found.items() for k in firsts}
    near = {(a, b) for b in range(n_renders) for a in range(max(0, b - 5), b)}
    assert not trained & measured
    assert trained | measured >= near


def test_only_the_pairs_that_are_left_are_drawn(folder):
    """A render 3 steps of 0.1 on shows the wall at depth 4 as 3 pixels farther left."""
    others = {(a, b) for b in range(7) for a in range(b)} - {(2, 5)}
    draw = RenderPairs(folder, batch=3, crop_px=16, seed=0, measured=others)
    for k in range(3):
        flow = draw(k).flow_px
        torch.testing.assert_close(flow[..., 0], torch.full_like(flow[..., 0], -3.0))


def test_renders_that_are_all_measured_are_refused(folder):
    every = {(a, b) for b in range(7) for a in range(b)}
    with rejects("temporal_loss.renders", 7):
        RenderPairs(folder, batch=1, crop_px=16, seed=0, measured=every)
