from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from unittest.mock import patch

import pytest
import torch
from expected_errors import rejects
from message_words import mentions
from tiny_style_training import TINY, style, trained
from torch import Tensor

from styletrf.configuration import configured
from styletrf.content.content_images import ContentConfig, write_content_images
from styletrf.content.content_sources import embedded_source
from styletrf.style.perceptual import painting_size
from styletrf.style.perceptual.perceptual_loss import PerceptualLossConfig, mean_terms
from styletrf.style.perceptual.vgg import VGG16
from styletrf.style.style_network import StyleNetwork, StyleNetworkConfig
from styletrf.style.training import step
from styletrf.style.training.checkpoint import read_checkpoint
from styletrf.style.training.config import StyleTrainingConfig, with_style_parameters
from styletrf.style.training.step import StyleStep
from styletrf.style.training.temporal_loss import (
    ContentPair,
    TemporalLossConfig,
    jittered_pair,
)
from styletrf.style.training.trainer import begin
from styletrf.style.transfer.network import TransferNetwork, TransferNetworkConfig


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("content")
    source = embedded_source([], n_procedural=8, seed=0)
    write_content_images(source, folder, ContentConfig(min_side_px=64))
    return folder


class KilledError(Exception):
    pass


def parameters(network: StyleNetwork) -> Tensor:
    return torch.cat([parameter.detach().flatten() for parameter in network.parameters()])


def killed_at(iteration: int):
    def progress(done: int, total: int, **quality: float) -> None:
        if done == iteration:
            raise KilledError

    return progress


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("iterations", 0), ("batch", 0), ("identity_iterations", -1), ("crop_px", 8),
        ("style_px", 15), ("normalization_share", 1.5), ("learning_rate", 0.0),
        ("final_learning_rate", -1e-3),
    ],
)  # fmt: skip
def test_settings_of_a_training_that_cannot_work_are_refused(name, value):
    """They ended in a traceback, after minutes."""
    with rejects(f"setting '{name}'", name):
        configured(StyleTrainingConfig, {name: value})


def test_a_stroke_scale_reaches_the_loss_however_few_pixels_the_painting_has(vgg: VGG16):
    """Up to the painting's own size alone: beyond it every scale gave the same network."""
    content = torch.rand(1, 3, 32, 32, generator=torch.Generator().manual_seed(0))
    losses = set()
    for scale in (1.0, 1.5, 2.0):
        training, config = begin(with_style_parameters(TINY, scale, 1.0), torch.device("cpu"))
        terms = StyleStep(config, vgg, style()).terms(training.network, 2, content)
        losses.add(float(terms.style.detach()))
    assert len(losses) == 3


def test_a_stroke_scale_without_further_effect_is_in_the_log(
    vgg: VGG16, content: Path, tmp_path: Path, caplog, monkeypatch
):
    monkeypatch.setattr(painting_size, "LARGEST_SQUARE_PX", 96)  # 1.5 times the painting
    config = with_style_parameters(replace(TINY, iterations=1), 4.0, 1.0)
    trained(config, vgg, content, tmp_path)
    assert mentions(caplog.text, "4", "1.5")


def test_loss_falls_and_the_curve_says_so(vgg: VGG16, content: Path, tmp_path: Path):
    """With little content and total variation, which pull against the style."""
    loss = PerceptualLossConfig(content_weight=0.1, style_weight=1.0, tv_weight=0.1)
    config = replace(
        TINY, iterations=24, identity_iterations=0, final_learning_rate=3e-3, loss=loss
    )
    _, curve = trained(config, vgg, content, tmp_path)
    assert [row.iteration for row in curve] == list(range(1, 25))
    assert sum(row.loss for row in curve[-5:]) < 0.75 * sum(row.loss for row in curve[:5])
    for row in curve:
        assert row.loss == pytest.approx(row.content + row.style + row.tv + row.temporal, rel=1e-5)
    assert all(a.seconds <= b.seconds for a, b in pairwise(curve))


@pytest.fixture(scope="module")
def whole(vgg: VGG16, content: Path, tmp_path_factory: pytest.TempPathFactory):
    """The network and the curve of a training that nothing stopped, and its folder."""
    folder = tmp_path_factory.mktemp("whole")
    return *trained(TINY, vgg, content, folder), folder


@pytest.mark.parametrize("checkpoint_s", [0.0, 1e9])
def test_a_killed_training_ends_as_one_never_killed(
    vgg: VGG16, content: Path, whole, tmp_path: Path, checkpoint_s: float
):
    network, whole_curve, _ = whole
    for iteration in (3, 6):
        with pytest.raises(KilledError):
            trained(
                TINY,
                vgg,
                content,
                tmp_path / "killed",
                progress=killed_at(iteration),
                checkpoint_s=checkpoint_s,
            )
    resumed, curve = trained(TINY, vgg, content, tmp_path / "killed")
    torch.testing.assert_close(parameters(resumed), parameters(network), rtol=1e-4, atol=1e-5)
    assert [row.iteration for row in curve] == list(range(1, TINY.iterations + 1))
    assert [row.loss for row in curve] == pytest.approx([r.loss for r in whole_curve], rel=1e-3)


def test_a_resumed_training_does_not_repeat_what_was_done(
    vgg: VGG16, content: Path, tmp_path: Path
):
    with pytest.raises(KilledError):
        trained(TINY, vgg, content, tmp_path, progress=killed_at(6), checkpoint_s=0.0)
    done: list[int] = []
    trained(TINY, vgg, content, tmp_path, progress=lambda k, total, **_: done.append(k))
    assert done == [6, 7, 8]


def test_a_finished_training_is_only_read(vgg: VGG16, content: Path, whole):
    first, curve, folder = whole
    again, same_curve = trained(TINY, vgg, content, folder, progress=killed_at(1))
    assert torch.equal(parameters(first), parameters(again))
    assert curve == same_curve
    assert [file.name for file in folder.iterdir()] == ["checkpoint.safetensors"]


def test_the_network_repeats_the_photograph_first_for_at_most_a_third_of_the_iterations(
    vgg: VGG16, content: Path, tmp_path: Path
):
    config = replace(TINY, iterations=180, identity_iterations=150, final_learning_rate=3e-3)
    with pytest.raises(KilledError):
        trained(config, vgg, content, tmp_path, progress=killed_at(70), checkpoint_s=0.0)
    training, _ = begin(config, vgg.mean.device)
    read_checkpoint(tmp_path, training)
    first, rest = training.curve[:60], training.curve[60:]
    assert len(rest) == 9
    assert all(row.style == row.tv == 0 for row in first)
    assert sum(row.content for row in first[-20:]) < sum(row.content for row in first[:20])
    assert all(row.style > 0 for row in rest)


def test_seed_decides_the_start(vgg: VGG16, content: Path, tmp_path: Path):
    short = replace(TINY, iterations=1)
    a, _ = trained(short, vgg, content, tmp_path / "a")
    b, _ = trained(replace(short, seed=1), vgg, content, tmp_path / "b")
    assert not torch.allclose(parameters(a), parameters(b))


@pytest.mark.parametrize("term", ["content", "style", "tv"])
def test_a_term_that_is_not_finite_stops_and_is_named(
    vgg: VGG16, content: Path, tmp_path: Path, term: str
):
    weights = {"content_weight": 1.0, "style_weight": 1.0, "tv_weight": 1.0}
    loss = PerceptualLossConfig(**(weights | {f"{term}_weight": 1e300}))
    with rejects("style training", term) as caught:
        trained(replace(TINY, identity_iterations=0, loss=loss), vgg, content, tmp_path)
    assert "--StyleNetwork-settings" in caught.value.remedy
    assert list(tmp_path.iterdir()) == []


def test_the_checkpoint_of_another_network_is_passed_over(
    vgg: VGG16, content: Path, tmp_path: Path
):
    trained(replace(TINY, iterations=1), vgg, content, tmp_path)
    other = replace(TINY, network=StyleNetworkConfig(width=8, n_residual=1))
    _, curve = trained(other, vgg, content, tmp_path)
    assert len(curve) == TINY.iterations


def test_training_in_bfloat16_loses_about_as_much_as_in_float32(
    vgg: VGG16, content: Path, tmp_path: Path
):
    config = replace(TINY, iterations=12, identity_iterations=0)
    _, exact = trained(config, vgg, content, tmp_path / "exact")
    with patch.object(step, "is_faster_in_bfloat16", lambda _: True):  # also where it is emulated
        _, fast = trained(replace(config, bfloat16=True), vgg, content, tmp_path / "fast")
    assert fast[0].loss == pytest.approx(exact[0].loss, rel=0.05)
    assert fast[-1].loss == pytest.approx(exact[-1].loss, rel=0.3)


def test_the_network_given_is_left_as_it_was(vgg: VGG16, content: Path, tmp_path: Path):
    before = {name: value.clone() for name, value in vgg.state_dict().items()}
    trained(replace(TINY, iterations=2, bfloat16=True), vgg, content, tmp_path)
    for name, value in vgg.state_dict().items():
        assert value.dtype == torch.float32
        assert torch.equal(value, before[name])


@pytest.mark.parametrize("threads", [1, 2])
def test_the_gradient_of_a_batch_is_the_mean_of_its_images(vgg: VGG16, threads: int):
    """Whatever the number of threads, and also of pairs that are held steady."""
    steady = TemporalLossConfig(weight=1.0, every=1)
    config = replace(TINY, identity_iterations=0, temporal_loss=steady)
    images = torch.rand(2, 3, 32, 32, generator=torch.Generator().manual_seed(0))
    pair = jittered_pair(images, steady, torch.Generator().manual_seed(1))

    def gradient(part: slice) -> Tensor:
        training, own = begin(config, torch.device("cpu"))
        content = ContentPair(*(getattr(pair, name)[part] for name in pair.__slots__))
        StyleStep(own, vgg, style())(training, 5, content)
        return torch.cat([p.grad.flatten() for p in training.network.parameters()])

    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        first, second, both = (gradient(part) for part in (slice(0, 1), slice(1, 2), slice(2)))
    finally:
        torch.set_num_threads(before)
    torch.testing.assert_close(both, (first + second) / 2, rtol=1e-4, atol=1e-6)
    assert not torch.allclose(first, second, rtol=1e-2)


def test_the_terms_of_images_computed_at_once_are_the_mean_of_their_own(vgg: VGG16):
    """On a GPU, whose networks were trained by another loss than on a CPU."""
    steady = TemporalLossConfig(weight=1.0, every=1)
    config = replace(TINY, identity_iterations=0, temporal_loss=steady)
    images = torch.rand(2, 3, 32, 32, generator=torch.Generator().manual_seed(0))
    images[0] = 0.1 * images[0]
    pair = jittered_pair(images, steady, torch.Generator().manual_seed(1))
    training, own = begin(config, torch.device("cpu"))
    initial = TransferNetwork(TransferNetworkConfig((2, 2, 2), 1), torch.Generator().manual_seed(2))
    of_images = StyleStep(replace(own, color_weight=2.0), vgg, style(), initial)
    parts = (ContentPair(*(getattr(pair, n)[k : k + 1] for n in pair.__slots__)) for k in (0, 1))
    each = [of_images.terms(training.network, 5, part) for part in parts]
    both, mean = of_images.terms(training.network, 5, pair), mean_terms(each)
    for term in ("content", "style", "tv", "temporal", "color"):
        torch.testing.assert_close(getattr(both, term), getattr(mean, term), rtol=1e-4, atol=1e-6)
    assert float(mean.color.detach()) > 0


def test_images_of_a_batch_are_moved_differently(vgg: VGG16):
    steady = TemporalLossConfig(weight=1.0, every=1)
    config = replace(TINY, identity_iterations=0, temporal_loss=steady)
    seen: list[ContentPair] = []

    class Watching(StyleStep):
        def terms(self, network, k, content):
            seen.append(content)
            return super().terms(network, k, content)

    training, own = begin(config, torch.device("cpu"))
    image = torch.rand(1, 3, 32, 32, generator=torch.Generator().manual_seed(0))
    Watching(own, vgg, style())(training, 0, image.expand(2, -1, -1, -1))
    first, second = (pair.second for pair in seen)
    assert not torch.equal(first, second)
