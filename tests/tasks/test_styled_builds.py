"""Every control on the mini scene: the stages build, and what they leave shows it."""

from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch

from styletrf.field.radiance_field import load_field, load_stylized_field
from styletrf.files.images import read_rgb, write_rgb
from styletrf.files.tables import read_rows
from styletrf.geometry.camera_table import read_cameras
from styletrf.style.interchange import to_fast_neural_style
from styletrf.style.style_network import load_style_network

Mini = Callable[..., Path]


def pictures(folder: Path) -> np.ndarray:
    return np.stack([read_rgb(path) for path in sorted((folder / "frames").glob("*.png"))])


def same(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(np.abs(a - b).max() <= 1.01 / 255)


def test_strength_and_blend_mix_the_frames(mini: Mini):
    style, other = (pictures(mini("StylizedFrames", **words)) for words in ({}, {"style": "q"}))
    none = pictures(mini("StylizedFrames", strength=0.0))
    assert not same(none, style)
    half = pictures(mini("StylizedFrames", strength=0.5))
    assert same(half, 0.5 * none + 0.5 * style)
    blend = pictures(mini("StylizedFrames", strength=0.8, blend={"q": 0.25}))
    assert same(blend, 0.2 * none + 0.6 * style + 0.2 * other)


def test_a_region_keeps_the_rest_as_it_was(mini: Mini, tmp_path_factory: pytest.TempPathFactory):
    style, none = (pictures(mini("StylizedFrames", strength=s)) for s in (1.0, 0.0))
    far = {"box": [[1e5, 1e5, 1e5], [2e5, 2e5, 2e5]]}
    assert same(pictures(mini("StylizedFrames", region=far)), none)
    mask = tmp_path_factory.mktemp("mask") / "white.png"
    view = read_cameras(mini("PriorRenders") / "cameras.parquet")[0]
    write_rgb(mask, np.ones((2 * view.height, 2 * view.width, 3), dtype=np.float32))
    shown = pictures(mini("StylizedFrames", region={"view": view.name, "mask": str(mask)}))
    assert np.abs(shown - style).mean() < np.abs(none - style).mean()


@pytest.mark.parametrize("colors", ["photograph", "luminance"])
def test_colors_of_the_photographs_come_back(mini: Mini, colors: str):
    from styletrf.trajectory.frames import float_frames

    plain = np.stack(list(float_frames(mini("PriorRenders"))))
    painted, recolored = (pictures(mini("StylizedPriors", **w)) for w in ({}, {"colors": colors}))
    if colors == "photograph":  # the mean of each channel, but for rounding
        before, after = (
            np.abs((p - plain).mean(axis=(0, 1, 2))).max() for p in (painted, recolored)
        )
        assert after < 1 / 255 < before
    else:  # the hues, but for what no screen can show
        before, after = (np.median(np.abs(hues(p) - hues(plain))) for p in (painted, recolored))
        assert after < 1 < before


def hues(frames: np.ndarray) -> np.ndarray:
    """The a* and b* of CIE L*a*b*, about -100 to 100."""
    return np.stack([cv2.cvtColor(frame, cv2.COLOR_RGB2LAB)[..., 1:] for frame in frames])


@pytest.mark.parametrize("strategy", ["s1", "s2"])
def test_free_strategies_leave_a_density_of_their_own(mini: Mini, strategy: str):
    folder = mini("StylizedField", strategy=strategy)
    own, usual = (
        load_stylized_field(mini("RadianceField"), each) for each in (folder, mini("StylizedField"))
    )
    plain = list(load_field(mini("RadianceField")).density.parameters())
    assert all(map(torch.equal, usual.density.parameters(), plain)), "which appearance alone keeps"
    assert not any(map(torch.equal, own.density.parameters(), plain))
    frames = mini("StylizedFrames", strategy=strategy)
    assert len(pictures(frames)) == len(list((frames / "own_depths").iterdir())) == 7
    pairs = read_rows(mini("ConsistencyMetrics", strategy=strategy) / "pairs.parquet")
    assert pairs
    assert all(0 <= pair["own_fraction"] <= 1 for pair in pairs)
    assert not (mini("StylizedFrames") / "own_depths").exists(), "the field's is theirs"


def test_whole_renders_are_matched_after_the_pixels(mini: Mini):
    folders = [mini("StylizedField", match=loss) for loss in ("pixels", "gram", "distributions")]
    planes = [
        load_field(mini("RadianceField"), folder).appearance.state_dict()["factors.planes.0"]
        for folder in folders
    ]
    for first, second in combinations(planes, 2):
        assert not torch.equal(first, second)
    assert not any((folder / "density.safetensors").exists() for folder in folders)


def test_an_optimization_lowers_the_loss_of_the_picture_it_starts_from(mini: Mini):
    from styletrf.style.perceptual.perceptual_loss import (
        PerceptualLossConfig,
        perceptual_loss,
        shrunk,
        style_grams,
    )
    from styletrf.style.perceptual.vgg import load_vgg
    from styletrf.trajectory.frames import float_frames

    vgg = load_vgg(mini("PerceptualWeights") / "vgg16.safetensors", torch.device("cpu"))
    painting = torch.from_numpy(read_rgb(mini("StyleImage") / "style.png"))
    grams = style_grams(vgg, shrunk(painting, 64))

    def losses(painted: np.ndarray) -> np.ndarray:
        pairs = zip(painted, float_frames(mini("PriorRenders")), strict=True)
        views = ([torch.from_numpy(view).movedim(2, 0)[None] for view in pair] for pair in pairs)
        found = (perceptual_loss(vgg, *pair, grams, PerceptualLossConfig()) for pair in views)
        return np.array([float(terms.total) for terms in found])

    by_network, optimized = (
        losses(pictures(mini("StylizedPriors", **words))) for words in ({}, {"stylizer": "gatys"})
    )
    assert (optimized < by_network).all()


def test_a_second_round_paints_the_mean_of_priors_and_of_what_the_first_round_shows(mini: Mini):
    from styletrf.style.style_network import stylize
    from styletrf.stylization.alternation import blend_with_previous_round
    from styletrf.stylization.color_transfer import in_colors
    from styletrf.trajectory.frames import float_frames, float_images

    priors, network = mini("PriorRenders"), load_style_network(mini("StyleNetwork"))
    inputs = {"field": mini("RadianceField"), "model": mini("SceneModel")}
    means = blend_with_previous_round(
        list(float_images(priors)),
        read_cameras(priors / "cameras.parquet"),
        inputs | {"before": mini("StylizedField")},
        torch.device("cpu"),
    )
    painted = [stylize(network, torch.from_numpy(view.color)).numpy() for view in means]
    painting = read_rgb(mini("StyleImage") / "style.png")
    colored = np.stack(in_colors(painted, list(float_frames(priors)), painting, "style"))
    assert same(pictures(mini("StylizedPriors", rounds=2)), colored)
    assert not same(pictures(mini("StylizedPriors")), colored)


def test_an_arbitrary_style_needs_no_training_and_brings_the_colors_of_the_painting(mini: Mini):
    arbitrary = {"stylizer": "arbitrary"}
    network = mini("StyleNetwork", **arbitrary)
    assert not (network / "curve.parquet").exists()
    painting = read_rgb(mini("StyleImage") / "style.png").mean(axis=(0, 1))
    looks = {"strength": 0.0, "path": "orbit"}, arbitrary | {"path": "orbit"}
    frames = [pictures(mini("StylizedFrames", **look)) for look in looks]
    assert len(frames[0]) == len(frames[1]) == 7
    before, after = (
        np.linalg.norm(shown.mean(axis=(1, 2)) - painting, axis=1).mean() for shown in frames
    )
    assert after < 0.8 * before


def test_an_optimization_can_start_from_noise(mini: Mini, stage_of: Any):
    stage = stage_of("StylizedPriors", stylizer="gatys", settings={"start": "noise"})[0]
    assert "network" not in stage.requires()


def test_every_surface_point_can_learn_from_all_priors(mini: Mini):
    """The plain fit is a setting, and gives another appearance."""
    folders = mini("StylizedField"), mini("StylizedField", settings={"single_owner": False})
    first, second = (load_field(mini("RadianceField"), f).appearance for f in folders)
    assert not torch.equal(first.factors.planes[0], second.factors.planes[0])


def test_per_frame_paints_what_the_network_paints_in_the_colors_of_painted_priors(mini: Mini):
    from styletrf.style.style_network import stylize
    from styletrf.stylization.color_transfer import in_colors
    from styletrf.trajectory.frames import float_frames

    network = load_style_network(mini("StyleNetwork"))
    plain = list(float_frames(mini("TrajectoryFrames")))
    painted = [stylize(network, torch.from_numpy(frame)).numpy() for frame in plain]
    painting = read_rgb(mini("StyleImage") / "style.png")
    colored = np.stack(in_colors(painted, plain, painting, "style"))
    assert same(pictures(mini("StylizedFrames", method="per-frame")), colored)


def test_a_network_that_is_given_is_used(mini: Mini, tmp_path: Path):
    johnson = {"warm_start": False, "network.width": 4, "network.n_residual": 1}
    network = load_style_network(mini("StyleNetwork", settings=johnson))
    torch.save(to_fast_neural_style(network), tmp_path / "p.pth")
    given = load_style_network(mini("StyleNetwork", network=str(tmp_path / "p.pth")))
    image = torch.rand(1, 3, 32, 40)
    with torch.no_grad():
        torch.testing.assert_close(given(image), network(image), atol=1e-4, rtol=0)
