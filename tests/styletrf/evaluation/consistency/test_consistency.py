import math
from dataclasses import replace

import numpy as np
import pytest
from expected_errors import rejects
from hypothesis import given
from hypothesis import strategies as st
from moving_camera import FRAMES, HEIGHT, STEP, WIDTH, camera, pan, shown, texture

from styletrf.evaluation.consistency.frame_pairs import planned_pairs, read_frame
from styletrf.evaluation.consistency.trajectory_consistency import (
    ConsistencyConfig,
    measure_consistency,
)
from styletrf.evaluation.perceptual_distance import PerceptualFeatures
from styletrf.field.rendering import Rendering
from styletrf.files.float_images import FloatImage
from styletrf.geometry.camera_table import read_cameras
from styletrf.trajectory.frames import write_float_frames, write_pictures


@pytest.fixture(scope="module")
def measure(vgg):
    def measured(plain, painted, *, painting=None, cameras=None, progress=None, cuts=(), **options):
        frames = shown(plain, painted, cameras)
        usual = {"perceptual_px": 32, "perceptual_pairs": 1}
        config = ConsistencyConfig(**usual | options)
        calls = {"progress": progress} if progress else {}
        look = PerceptualFeatures(vgg, config.perceptual_px)
        painting = texture(1) if painting is None else painting
        return measure_consistency(frames, len(plain), painting, look, config, **calls, cuts=cuts)

    return measured


@pytest.fixture(scope="module")
def consistent(measure):
    """Of one painting on the wall."""
    return measure(pan(texture(0)), pan(texture(1)), perceptual_pairs=4)


@pytest.fixture(scope="module")
def faithful(measure):
    """Of one painting on the wall, with a little noise."""
    return measure(pan(texture(0)), flickering(pan(texture(1)), 0.02))


def flickering(frames, sigma, seed=0):
    random = np.random.default_rng(seed)
    return [frame + random.normal(0, sigma, frame.shape).astype(np.float32) for frame in frames]


def test_a_pan_over_one_painting_is_consistent(consistent):
    result = consistent
    variance = float(texture(1).var())
    for delta in ("delta_1", "delta_5"):
        figures = result.summary[delta]
        assert figures["masked_error"] < 0.01 * variance
        assert figures["masked_floor"] < 0.01 * variance
        assert figures["valid_fraction"] > 0.7
        assert figures["geometric_error"] < 1e-9, "whole pixels are found exactly"
        assert figures["normalized_error"] < 1e-3
        assert figures["perceptual_error"] < 0.05
    fractions = [result.summary[f"delta_{d}"]["geometric_fraction"] for d in (1, 5)]
    assert fractions == pytest.approx([1 - STEP * d / WIDTH for d in (1, 5)], abs=0.02)


def test_a_painting_that_stays_on_the_screen_is_inconsistent(measure, consistent):
    still = measure(pan(texture(0)), [pan(texture(1))[0]] * FRAMES, perceptual_pairs=4)
    for delta in ("delta_1", "delta_5"):
        for name in ("error", "geometric_error", "normalized_error", "perceptual_error"):
            assert still.summary[delta][name] > 5 * consistent.summary[delta][name], name
        for name in ("floor", "geometric_floor", "normalized_floor", "perceptual_floor"):
            assert still.summary[delta][name] == consistent.summary[delta][name], name


def test_unrelated_pictures_have_a_normalized_error_of_one(measure):
    painted = [texture(10 + k, WIDTH) for k in range(FRAMES)]
    painted = [frame - frame.mean(axis=(0, 1)) + 0.5 for frame in painted]
    for contrast in (1.0, 0.1):
        gray = [0.5 + contrast * (frame - 0.5) for frame in painted]
        figures = measure(pan(texture(0)), gray).summary["delta_1"]
        assert figures["normalized_error"] == pytest.approx(1, rel=0.1)


@pytest.mark.parametrize("sigma", [0.02, 0.1])
def test_flicker_is_measured_as_twice_its_variance(measure, sigma):
    still = [pan(texture(0))[0]] * FRAMES  # no motion: the warp neither smooths nor shifts
    painted = flickering(pan(texture(1))[:1] * FRAMES, sigma)
    result = measure(still, painted, cameras=[camera(0)] * FRAMES)
    for delta in ("delta_1", "delta_5"):
        for kind in ("", "geometric_"):
            figures = result.summary[delta]
            assert figures[f"{kind}error"] == pytest.approx(2 * sigma**2, rel=0.05)
            assert figures[f"{kind}floor"] < 1e-9
        assert figures["normalized_error"] > sigma**2, "contrasts are below 1"
        assert figures["normalized_floor"] == 0


def test_detail_of_four_pixels_is_no_error_half_a_pixel_further(measure):
    """Linear interpolation would blur one frame of each pair: an error of 0.06."""
    cameras = [camera(k / (2 * STEP)) for k in range(FRAMES)]
    columns = np.arange(WIDTH)[None, :, None] + np.arange(3)
    stripes = [
        np.tile(0.5 + 0.4 * np.sin(np.pi / 2 * (columns + k / 2)), (HEIGHT, 1, 1))
        for k in range(FRAMES)
    ]
    frames = [stripe.astype(np.float32) for stripe in stripes]
    assert measure(frames, frames, cameras=cameras).summary["delta_1"]["normalized_error"] < 0.002


def assert_same(value, other):
    """Equal, or not compared."""
    assert value == other or math.isnan(value) is math.isnan(other) is True


def test_stylization_that_changes_nothing_is_at_the_floor(measure):
    result = measure(pan(texture(0)), pan(texture(0)), painting=texture(1))
    for pair in result.pairs:
        for name in ("", "masked_", "geometric_", "normalized_", "perceptual_"):
            assert_same(pair[f"{name}error"], pair[f"{name}floor"])
        assert_same(pair["style_distance"], pair["style_distance_unstylized"])


def test_a_gray_video_does_not_beat_a_faithful_one(measure):
    """Less contrast lowers the paper's error; not the normalized one."""
    faithful = flickering(pan(texture(1)), 0.02)
    gray = [np.round((0.5 + 0.05 * (f - 0.5)) * 255) / 255 for f in faithful]
    kept, washed = (
        measure(pan(texture(0)), f, painting=faithful[0]).summary["delta_1"]
        for f in (faithful, gray)
    )
    assert washed["error"] < 0.1 * kept["error"]
    assert washed["normalized_error"] > kept["normalized_error"]
    assert washed["style_distance"] > kept["style_distance"]


@pytest.mark.parametrize("contrast", [0.3, 0.05, 0.0])
def test_a_faded_video_has_a_larger_error_by_contrast(measure, faithful, contrast):
    """Not even without the noise of rounding to 8 bits."""
    faded = [0.5 + contrast * (f - 0.5) for f in flickering(pan(texture(1)), 0.02)]
    figures = [result.summary["delta_1"] for result in (faithful, measure(pan(texture(0)), faded))]
    assert figures[1]["normalized_error"] > figures[0]["normalized_error"]


def test_a_gray_object_on_white_does_not_beat_a_faithful_one(measure):
    """What contrast it has, at its rim, is none of its own."""
    inside = np.zeros((HEIGHT, WIDTH + 2 * FRAMES, 1), np.float32)
    inside[15:-15, 30:-40] = 1

    def on_white(wall):
        return pan(inside * wall[:, : inside.shape[1]] + 1 - inside)

    scene, painted = on_white(texture(0)), on_white(texture(1))
    gray = on_white(np.full_like(texture(1), 0.5))
    kept, mush = (measure(scene, f).summary["delta_1"] for f in (flickering(painted, 0.02), gray))
    assert mush["normalized_error"] > 2 * kept["normalized_error"]


def test_a_video_without_contrast_is_as_good_as_unrelated_pictures(measure):
    figures = measure(pan(texture(0)), [np.full((HEIGHT, WIDTH, 3), 0.5, np.float32)] * FRAMES)
    assert figures.summary["delta_1"]["normalized_error"] == pytest.approx(1)
    assert figures.summary["delta_1"]["normalized_floor"] < 1e-3


def test_a_scene_without_detail_has_no_normalized_error(measure):
    figures = measure([np.full((HEIGHT, WIDTH, 3), 0.5, np.float32)] * FRAMES, pan(texture(1)))
    assert figures.summary["delta_1"]["normalized_error"] is None
    assert figures.summary["delta_1"]["pairs_without_contrast"] == FRAMES - 1


def test_the_painting_itself_has_all_of_the_style(measure):
    painted = [texture(1, WIDTH)] * FRAMES
    figures = measure(pan(texture(0)), painted, painting=texture(1, WIDTH)).summary["delta_1"]
    assert figures["style_distance"] == pytest.approx(0, abs=1e-5)
    assert figures["style_distance_unstylized"] > 0.02


def test_there_is_a_row_for_every_pair_and_the_summary_is_their_mean(measure):
    result = measure(pan(texture(0)), flickering(pan(texture(1)), 0.05))
    assert [(p["first"], p["second"], p["delta"]) for p in result.pairs] == [
        (i, i + delta, delta) for delta in (1, 5, 7) for i in range(FRAMES - delta)
    ]
    assert {pair["flow"] for pair in result.pairs if pair["delta"] < 7} == {"dis"}
    for name in ("error", "geometric_error"):
        short = [pair[name] for pair in result.pairs if pair["delta"] == 1]
        assert result.summary["delta_1"][name] == pytest.approx(np.mean(short))
    assert result.summary["delta_1"]["pairs"] == FRAMES - 1


def test_along_the_depth_alone_nothing_else_is_measured(measure):
    result = measure(pan(texture(0)), flickering(pan(texture(1)), 0.05), deltas=(1,))
    far = result.summary["delta_7"]
    assert far["normalized_error"] > 0
    assert not {"error", "flow", "perceptual_error", "style_distance"} & set(far)
    alone = [pair for pair in result.pairs if pair["delta"] == 7]
    assert alone
    assert all(math.isnan(p["error"]) and math.isnan(p["perceptual_error"]) for p in alone)


def test_the_summary_names_the_flow_where_pairs_along_the_depth_are_nearer(measure):
    """The first row, a pair along the depth alone, has none."""
    frames = pan(texture(0))
    result = measure(frames, frames, deltas=(5,), depth_deltas=(1,))
    assert result.summary["delta_5"]["flow"] == "dis"


def test_no_pair_goes_across_a_known_cut(measure):
    """Two walls, one after the other: each is consistent, whatever lies between."""
    plain = pan(texture(0)) + pan(texture(5))
    painted = pan(texture(1)) + pan(texture(6))
    cameras = [replace(camera(k % FRAMES), name=f"{k}") for k in range(2 * FRAMES)]
    blind, aware = (
        measure(plain, painted, cameras=cameras, cuts=cuts, pairs=99) for cuts in ((), (FRAMES,))
    )
    assert aware.summary["delta_1"]["pairs"] == 2 * (FRAMES - 1)
    assert aware.summary["delta_7"]["pairs"] == 2 * (FRAMES - 7)
    assert aware.summary["delta_1"]["geometric_error"] < 1e-9
    assert blind.summary["delta_1"]["geometric_error"] > 1e-4


@pytest.mark.parametrize("contrast", [1.0, 0.05, 0.0])
def test_stills_without_motion_are_measured_and_are_steady(measure, contrast):
    held = FRAMES // 2
    plain = [texture(0, WIDTH)] * held + [texture(5, WIDTH)] * held
    painted = [0.5 + contrast * (texture(seed, WIDTH) - 0.5) for seed in (1, 6)]
    painted = [painted[0]] * held + [painted[1]] * held
    cameras = [replace(camera(10 * (k // held)), name=f"{k}") for k in range(FRAMES)]
    figures = measure(plain, painted, cameras=cameras, cuts=(held,)).summary
    assert figures["delta_1"]["error"] == pytest.approx(0, abs=1e-6)
    assert figures["delta_1"]["geometric_fraction"] == pytest.approx(1)
    assert figures["delta_1"]["normalized_error"] == figures["delta_1"]["normalized_floor"] == 0
    assert figures["delta_5"]["pairs"] == 0
    assert figures["delta_5"]["error"] is None


def test_stills_too_short_for_any_pair_are_refused(measure):
    with rejects(f"{FRAMES} frames"):
        measure(pan(texture(0)), pan(texture(1)), cuts=range(1, FRAMES))


@given(st.integers(2, 90), st.lists(st.integers(1, 89), max_size=5))
def test_no_pair_goes_across_a_cut(n_frames, cuts):
    planned = planned_pairs(n_frames, ConsistencyConfig(pairs=99), cuts)
    assert not any(pair.first < cut <= pair.second for pair in planned for cut in cuts)


@given(st.integers(2, 90), st.integers(1, 20), st.integers(1, 9))
def test_pairs_are_spread_from_end_to_end_and_never_twice(n_frames, pairs, perceptual_pairs):
    config = ConsistencyConfig(pairs=pairs, perceptual_pairs=perceptual_pairs)
    planned = planned_pairs(n_frames, config)
    for delta in (1, 5, 7):
        of_delta = [pair for pair in planned if pair.delta == delta]
        firsts = [pair.first for pair in of_delta]
        looked_at = [pair for pair in of_delta if pair.has_looks]
        assert len(set(firsts)) == len(firsts) == min(pairs, max(0, n_frames - delta))
        assert len(looked_at) == (min(perceptual_pairs, len(firsts)) if delta < 7 else 0)
        if len(firsts) > 1:
            assert (firsts[0], of_delta[-1].second) == (0, n_frames - 1)


def test_files_and_arrays_give_the_same(measure, vgg, tmp_path):
    plain, painted = pan(texture(0))[:4], pan(texture(1))[:4]
    cameras = [camera(k) for k in range(4)]
    import torch

    whole = torch.ones(HEIGHT, WIDTH)
    renders = [
        Rendering(torch.from_numpy(np.ascontiguousarray(p)), whole, 10 * whole, 10 * whole)
        for p in plain
    ]
    for name in "ab":
        (tmp_path / name).mkdir()
    write_float_frames(tmp_path / "a", cameras, iter(renders))
    write_pictures(tmp_path / "b", [c.name for c in cameras], iter(painted))
    read = read_cameras(tmp_path / "a" / "cameras.parquet")
    frames = (read_frame(tmp_path / "a", tmp_path / "b", c) for c in read)
    config = ConsistencyConfig(deltas=(1,), perceptual_px=32, perceptual_pairs=1)
    from_files = measure_consistency(frames, 4, texture(1), PerceptualFeatures(vgg, 32), config)
    from_arrays = measure(plain, painted, deltas=(1,))
    for file_row, array_row in zip(from_files.pairs, from_arrays.pairs, strict=True):
        assert file_row.pop("flow") == array_row.pop("flow")
        assert file_row == pytest.approx(array_row, rel=5e-2, abs=2e-5, nan_ok=True)


def test_frames_are_read_when_their_turn_comes(vgg):
    read = []

    def recorded():
        for index, frame in enumerate(shown(pan(texture(0)), pan(texture(1)))):
            read.append(index)
            yield frame

    seen = []

    def progress(done, total, **quality):
        seen.append((done, total, max(read)))

    config = ConsistencyConfig(deltas=(1,), depth_deltas=(), perceptual_px=16)
    look = PerceptualFeatures(vgg, 16)
    measure_consistency(recorded(), FRAMES, texture(1), look, config, progress)
    assert seen == [(i, FRAMES - 1, i) for i in range(1, FRAMES)]


def test_a_flash_from_black_to_white_is_an_error_of_one(measure):
    flash = [np.zeros((HEIGHT, WIDTH, 3), np.float32), np.ones((HEIGHT, WIDTH, 3), np.float32)]
    pair = measure([texture(0, WIDTH)] * 2, flash, cameras=[camera(0)] * 2, deltas=(1,)).pairs[0]
    assert (pair["error"], pair["floor"], pair["masked_error"]) == (1, 0, 1)
    assert (pair["geometric_error"], pair["geometric_floor"]) == (1, 0)


def test_frames_with_nothing_in_common_are_said_to_have_none(measure):
    frames = [texture(seed, WIDTH) for seed in range(2)]
    result = measure(frames, frames, cameras=[camera(0), camera(1000)], deltas=(1,))
    pair = result.pairs[0]
    assert pair["valid_fraction"] < 0.6
    assert pair["geometric_fraction"] == 0
    for name in ("geometric_error", "normalized_error", "perceptual_error"):
        assert math.isnan(pair[name])
        assert result.summary["delta_1"][name] is None
    assert result.summary["delta_1"]["pairs_without_correspondence"] == 1
    assert result.summary["delta_1"]["pairs_without_contrast"] == 0


def test_what_is_hidden_in_the_other_frame_is_left_out(measure, vgg):
    """Half of the second frame is nearer by half: it hides what the first one sees there."""
    frames = list(shown(pan(texture(0))[:2], pan(texture(1))[:2]))
    near = frames[1].unstylized.depth.copy()
    near[:, WIDTH // 2 :] /= 2
    plain = frames[1].unstylized
    hidden = FloatImage(plain.color, plain.opacity, near)
    from dataclasses import replace

    frames[1] = replace(frames[1], unstylized=hidden)
    config = ConsistencyConfig(deltas=(1,), perceptual_px=16)
    pair = measure_consistency(frames, 2, texture(1), PerceptualFeatures(vgg, 16), config).pairs[0]
    assert pair["geometric_fraction"] == pytest.approx(0.5 - STEP / WIDTH, abs=0.03)
    assert pair["geometric_error"] < 1e-9


def test_a_distance_without_pairs_is_null(measure):
    result = measure(pan(texture(0))[:3], pan(texture(1))[:3])
    figures = dict(result.summary["delta_5"])
    counts = [name for name in figures if "pairs" in name]
    assert {figures.pop(name) for name in counts} == {0}
    assert figures.pop("flow") == "dis"
    assert set(figures.values()) == {None}
    assert result.pairs
    assert all(math.isfinite(pair["error"]) for pair in result.pairs)


def test_what_cannot_be_compared_is_refused(measure):
    plain, painted = pan(texture(0)), pan(texture(1))
    with rejects("1 frames"):
        measure(plain[:1], painted[:1])
    with pytest.raises(ValueError, match=r"deltas.*\(0, 1\)"):
        measure(plain, painted, deltas=(0, 1))
    with rejects("frame 3", "90x72", "96x72"):
        measure(plain, [*painted[:3], painted[3][:, :90], *painted[4:]])
