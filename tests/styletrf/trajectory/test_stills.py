"""Stills of photographs, where no fly-through can be given."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from trajectory_captures import modeled

from styletrf.files.tables import read_summary
from styletrf.geometry.lenses import focal_from, focal_of
from styletrf.trajectory.chosen_path import default_path
from styletrf.trajectory.frames import FramesConfig
from styletrf.trajectory.stills import MOST_STILLS, Still, cuts_of, stills
from styletrf.trajectory.support import Support
from styletrf.trajectory.supported_path import write_support
from styletrf.trajectory.trajectories import fly_through
from styletrf.trajectory.trajectory_config import TrajectoryConfig

VIEWS, MODEL = modeled("forward")
PHOTOGRAPHS = [replace(view, name=f"IMG_{k}") for k, view in enumerate(VIEWS)]
CONFIG = FramesConfig(trajectory=TrajectoryConfig(frames=60))


def supported(path) -> Support:
    return Support({camera.name: 0.0 for camera in path})


def unsupported(path) -> Support:
    return Support({camera.name: 0.3 for camera in path})


def partly_supported(path) -> Support:
    return Support({camera.name: 0.1 for camera in path})


def path(measure, config=CONFIG, *, has_parallax=True):
    return default_path(PHOTOGRAPHS, MODEL, config, measure, has_parallax=has_parallax)


@settings(deadline=None)
@given(st.integers(1, 600), st.integers(24, 60), st.integers(1, len(PHOTOGRAPHS)))
def test_stills_fill_the_length_evenly_with_photographs_in_their_order(n_frames, rate, n_views):
    frames, shown = stills(PHOTOGRAPHS[:n_views], n_frames, rate)
    assert [frame.name for frame in frames] == [f"{k:04d}" for k in range(n_frames)]
    assert 1 <= len(shown) <= min(MOST_STILLS, n_views)
    firsts = [still.first_frame for still in shown]
    lengths = np.diff([*firsts, n_frames])
    assert firsts[0] == 0
    assert np.ptp(lengths) <= 1
    assert len(shown) == 1 or lengths.min() >= rate // 2
    numbers = [int(still.photograph.removeprefix("IMG_")) for still in shown]
    assert numbers == sorted(set(numbers))


def test_photographs_of_other_sizes_are_shown_cropped_to_the_shape_of_most():
    """Of a tourist's photographs hardly two have one size: a single one was shown for all."""
    odd = [
        replace(camera, width=camera.width - k, height=camera.height + k)
        for k, camera in enumerate(PHOTOGRAPHS[:5])
    ]
    frames, shown = stills(odd, 96, 24)
    assert len(shown) == 5
    assert len({(frame.width, frame.height) for frame in frames}) == 1
    for still in shown:
        own = odd[int(still.photograph.removeprefix("IMG_"))]
        frame = frames[still.first_frame]
        corners = np.array([[0, 0], [frame.width, frame.height]])
        rays = (corners - [frame.cx, frame.cy]) / [frame.fx, frame.fy]
        pixels = rays * [own.fx, own.fy] + [own.cx, own.cy]
        assert (pixels > -1e-6).all()
        assert (pixels < np.array([own.width, own.height]) + 1e-6).all()


def test_a_photograph_across_the_others_is_left_out():
    first, *others = PHOTOGRAPHS
    across = replace(first, width=first.height, height=first.width, cx=first.cy, cy=first.cx)
    assert len(stills([across, *others[:3]], 96, 24)[1]) == 3


def test_a_still_is_the_photographs_own_view():
    frames, shown = stills(PHOTOGRAPHS, 96, 24)
    own = {photograph.name: photograph for photograph in PHOTOGRAPHS}
    for still, end in zip(shown, [*(s.first_frame for s in shown[1:]), 96], strict=True):
        for frame in frames[still.first_frame : end]:
            named = replace(frame, name=still.photograph)
            np.testing.assert_equal(named, own[still.photograph])


def test_stills_have_the_shape_of_most_photographs():
    standing = replace(
        PHOTOGRAPHS[0], width=PHOTOGRAPHS[0].height, height=PHOTOGRAPHS[0].width, name="standing"
    )
    frames, shown = stills([standing, *PHOTOGRAPHS], 240, 24)
    assert {(frame.width, frame.height) for frame in frames} == {
        (PHOTOGRAPHS[0].width, PHOTOGRAPHS[0].height)
    }
    assert "standing" not in {still.photograph for still in shown}


def test_a_supported_scene_with_parallax_gets_its_fly_through():
    found = path(supported)
    expected = fly_through(PHOTOGRAPHS, MODEL, CONFIG.trajectory)
    np.testing.assert_equal(
        [c.center_world for c in found.cameras], [c.center_world for c in expected]
    )
    assert (found.stills, found.reason) == ((), "")


def test_a_path_of_which_a_tenth_is_unsupported_stays_a_fly_through_with_a_warning(
    tmp_path, caplog
):
    found = path(partly_supported)
    assert (found.stills, found.reason) == ((), "")
    write_support(tmp_path / "support.json", "auto", found, CONFIG.support)
    assert 10 in [float(percent) for percent in re.findall(r"([\d.]+)%", caplog.text)]


@pytest.mark.parametrize("measure", [supported, unsupported])
def test_photographs_that_tell_no_depth_give_stills(measure):
    found = path(measure, has_parallax=False)
    assert len(found.stills) > 1
    assert "no depth" in found.reason
    assert len(found.cameras) == 60


@pytest.mark.parametrize("extent", [0.0, 1e-9])
def test_photographs_with_poses_that_lie_at_one_place_give_stills(extent):
    """Given poses are taken to have parallax: the fly-through was a frame again and again."""
    rng, place = np.random.default_rng(0), PHOTOGRAPHS[0].center_world
    at_one = [
        replace(
            camera,
            world_from_camera=np.column_stack(
                [camera.world_from_camera[:, :3], place + extent * rng.normal(size=3)]
            ),
        )
        for camera in PHOTOGRAPHS
    ]
    found = default_path(at_one, MODEL, CONFIG, supported, has_parallax=True)
    assert len(found.stills) > 1
    assert "no depth" in found.reason


def test_a_path_that_stays_unsupported_becomes_stills_and_lists_what_was_tried():
    found = path(unsupported)
    assert len(found.stills) > 1
    assert "30.0%" in found.reason
    assert len(found.trials) > 1


def test_an_angle_of_view_that_was_asked_for_is_no_reason_for_stills():
    asked = replace(CONFIG, trajectory=replace(CONFIG.trajectory, fov_deg=60.0))
    assert path(unsupported, asked).stills == ()
    frames = path(unsupported, asked, has_parallax=False).cameras
    assert [focal_of(frame) for frame in frames] == pytest.approx([focal_from(60.0)] * 60)


def test_the_file_and_the_log_tell_the_stills_in_one_line(tmp_path, caplog):
    found = path(unsupported)
    write_support(tmp_path / "support.json", "auto", found, CONFIG.support)
    (record,) = caplog.records
    assert found.reason in record.message
    assert "\n" not in record.message
    support = read_summary(tmp_path / "support.json")
    assert [Still(**still) for still in support["stills"]] == list(found.stills)
    assert cuts_of(support) == [still.first_frame for still in found.stills[1:]]


def test_a_fly_through_has_no_cuts(tmp_path):
    write_support(tmp_path / "support.json", "auto", path(supported), CONFIG.support)
    assert cuts_of(read_summary(tmp_path / "support.json")) == []
