import cv2
import numpy as np
import pytest
from expected_errors import rejects

from styletrf.configuration import configured
from styletrf.evaluation.consistency.trajectory_consistency import ConsistencyConfig
from styletrf.evaluation.flow import METHODS, FlowEstimator, agreement, warp_to_a


def texture(height=128, width=160, seed=0):
    noise = np.random.default_rng(seed).random((height, width, 3)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 2.5)
    return (smooth - smooth.min()) / (smooth.max() - smooth.min())


def constant_flow(height, width, x, y):
    return np.broadcast_to(np.float32([x, y]), (height, width, 2)).copy()


@pytest.mark.parametrize("method", [m for m in METHODS if m != "raft"])
def test_a_shifted_texture_has_the_flow_of_its_shift(method):
    large = texture()
    a, b = large[10:106, 10:138], large[13:109, 5:133]  # b(p) = large(p + (5, 13) - (10, 10) + ...)
    flow = FlowEstimator(method)(a, b)
    inner = flow[16:-16, 16:-16]  # a(p) = large(p + 10), b(q) = large(q + (5, 13)): q = p + (5, -3)
    assert np.abs(inner - np.float32([5, -3])).mean() < 0.15


def test_the_same_frame_does_not_move():
    assert np.abs(FlowEstimator()(texture(), texture())).max() < 0.05


def test_exchanging_the_frames_turns_the_flow_around():
    large = texture(seed=3)
    a, b = large[:, :140], large[:, 4:144]
    there, back = FlowEstimator()(a, b), FlowEstimator()(b, a)
    assert there[20:-20, 20:-20] == pytest.approx(-back[20:-20, 20:-20], abs=0.3)


@pytest.mark.parametrize("height", [1, 12, 15])
@pytest.mark.parametrize("width", [160, 504])
def test_flat_wide_frames_are_refused(height, width):
    """OpenCV crashed the process."""
    with rejects(f"{width}x{height}", "too small"):
        FlowEstimator()(texture(height, width), texture(height, width))


@pytest.mark.parametrize("height", [16, 24])
@pytest.mark.parametrize("width", [160, 504])
def test_flat_wide_frames_that_are_not_refused_have_finite_flow(height, width):
    assert np.isfinite(FlowEstimator()(texture(height, width), texture(height, width, 1))).all()


@pytest.mark.parametrize(("x", "y"), [(0, 0), (3, 0), (0, -2), (-4, 5)])
def test_whole_pixels_are_moved_exactly(x, y):
    b = texture(40, 50)
    warped, inside = warp_to_a(b, constant_flow(40, 50, x, y))
    assert np.array_equal(warped[inside], np.roll(b, (-y, -x), axis=(0, 1))[inside])
    assert inside.sum() == (40 - abs(y)) * (50 - abs(x))


@pytest.mark.parametrize(
    ("interpolation", "fraction"), [("linear", 4 / 9), ("cubic", (6 / 7) ** 2)]
)
def test_a_warp_keeps_this_share_of_the_variance_of_noise(interpolation, fraction):
    """The mean, over places between pixels, of the sum of the squared weights."""
    random = np.random.default_rng(0)
    noise = random.normal(size=(400, 400, 3)).astype(np.float32)
    flow = random.uniform(-2, 2, (400, 400, 2)).astype(np.float32)
    warped, inside = warp_to_a(noise, flow, interpolation)
    assert warped[inside].var() == pytest.approx(fraction, rel=0.02)


def test_detail_of_four_pixels_survives_a_cubic_warp():
    columns = np.indices((30, 80, 3), dtype=np.float32)[1]
    stripes = np.sin(np.pi / 2 * columns).astype(np.float32)
    flow = np.random.default_rng(0).uniform(-4, 4, (30, 80, 2)).astype(np.float32)
    flow[..., 1] = 0
    expected = np.sin(np.pi / 2 * (columns + flow[..., :1]))
    for interpolation, least, most in (("linear", 0.2, 1.0), ("cubic", 0.0, 0.03)):
        warped, _ = warp_to_a(stripes, flow, interpolation)
        error = np.abs(warped - expected)[:, 8:-8].max()
        assert least < error < most


def test_a_linear_image_is_warped_exactly_between_pixels():
    y, x = np.indices((30, 40), dtype=np.float32)
    ramp = np.stack([x, y, x - 2 * y], axis=-1)
    flow = np.random.default_rng(0).uniform(-3, 3, (30, 40, 2)).astype(np.float32)
    warped, inside = warp_to_a(ramp, flow)
    moved = np.stack([x + flow[..., 0], y + flow[..., 1]], axis=-1)
    expected = np.concatenate([moved, moved[..., :1] - 2 * moved[..., 1:]], axis=-1)
    assert 0.5 < inside.mean() < 1
    assert warped[inside] == pytest.approx(expected[inside], abs=1e-3)


def test_outside_repeats_the_border_and_is_marked():
    b = texture(20, 20)
    warped, inside = warp_to_a(b, constant_flow(20, 20, 100, 0))
    assert not inside.any()
    assert np.array_equal(warped, np.broadcast_to(b[:, -1:], b.shape))


def test_flows_that_cancel_agree_and_flows_that_do_not_disagree():
    there = constant_flow(30, 40, 4, 0)
    valid = agreement(there, -there)
    assert valid[:, :36].all()
    assert not valid[:, 36:].any()
    assert not agreement(there, constant_flow(30, 40, 0, 0)).any()


def test_what_disappears_behind_something_else_is_invalid():
    background, square = texture(seed=1), texture(48, 48, seed=2)
    a, b = background.copy(), background.copy()
    a[40:88, 40:88] = square
    b[40:88, 50:98] = square  # moves right by 10 and covers columns 88-98 of the background
    valid = agreement(FlowEstimator()(a, b), FlowEstimator()(b, a))
    assert valid[48:80, 89:97].mean() < 0.4
    assert valid[48:80, 48:72].mean() > 0.9
    assert valid[:, 110:].mean() > 0.9


def test_an_unknown_method_of_flow_is_refused_with_those_there_are():
    with rejects("setting 'method'", "psychic", remedy=METHODS):
        configured(ConsistencyConfig, {"method": "psychic"})


def test_frames_too_small_for_flow_are_refused():
    with rejects("40x11"):
        FlowEstimator()(texture(11, 40), texture(11, 40))
