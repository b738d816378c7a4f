"""Held-out views and their metrics."""

from pathlib import Path

import numpy as np
import pytest
import torch
from expected_errors import rejects
from mini_scene import painted_plane

from styletrf.errors import InputError
from styletrf.evaluation.lpips_distance import lpips_metric
from styletrf.evaluation.metrics import psnr
from styletrf.evaluation.quality import measure_quality, views_that_count
from styletrf.field.rendering import Rendering
from styletrf.files.images import read_rgb
from styletrf.files.published_weights import ALEXNET, VGG16


def test_each_metric_has_a_column_and_a_mean(tmp_path):
    scene = painted_plane(3)
    whole = torch.ones(scene.images.shape[1:3])
    noise = torch.Generator().manual_seed(0)
    renders = [
        Rendering((i / 255 + s * torch.randn(i.shape, generator=noise)).clamp(0, 1), *[whole] * 3)
        for i, s in zip(scene.images, (0.01, 0.05, 0.1), strict=True)
    ]
    metrics = {"psnr": psnr, "brightness": lambda image, reference: float(image.mean())}
    rows, means = measure_quality(renders, scene.cameras, scene.images, metrics, tmp_path)
    assert [row["view"] for row in rows] == [c.name for c in scene.cameras]
    assert [row["psnr"] for row in rows] == sorted((row["psnr"] for row in rows), reverse=True)
    assert means["psnr"] == pytest.approx(np.mean([row["psnr"] for row in rows]))
    assert means["brightness"] == pytest.approx(np.mean([row["brightness"] for row in rows]))
    assert means["views"] == 3
    height, width = scene.images.shape[1:3]
    assert read_rgb(tmp_path / f"{scene.cameras[0].name}.png").shape == (height, 2 * width, 3)


@pytest.mark.parametrize(("network", "weights"), [("alex", ALEXNET), ("vgg", VGG16)])
def test_lpips_that_is_not_at_hand_is_said(monkeypatch, network, weights):
    monkeypatch.setattr(torch.hub, "get_dir", lambda: "/nowhere")
    with pytest.raises(InputError) as caught:
        lpips_metric(torch.device("cpu"), network)
    assert caught.value.subject in ("LPIPS", f"/nowhere/checkpoints/{weights}")


def test_lpips_is_zero_between_equals_and_grows_with_noise():
    pytest.importorskip("lpips", reason="lpips is not installed (extra lpips)")
    weights = Path(torch.hub.get_dir(), "checkpoints", ALEXNET)
    if not weights.is_file():
        pytest.skip(f"AlexNet's weights are not in {weights}")
    metric = lpips_metric(torch.device("cpu"))
    image = np.random.default_rng(0).random((64, 64, 3)).astype(np.float32)
    noisy = [image + s * np.random.default_rng(1).normal(size=image.shape) for s in (0.1, 0.3)]
    found = [metric(image, image), *(metric(n.clip(0, 1).astype(np.float32), image) for n in noisy)]
    assert found[0] == pytest.approx(0, abs=1e-5)
    assert found == sorted(found)


def test_what_a_mask_leaves_out_does_not_count(tmp_path):
    scene = painted_plane(1)
    mask = torch.full((*scene.images.shape[1:3], 1), 255, dtype=torch.uint8)
    mask[:, :7] = 0
    photograph = torch.cat([scene.images[0], mask], dim=2)
    color = scene.images[0] / 255
    color[:, 7:] += 0.1
    wrong = color.clone()
    wrong[:, :7] = 0
    whole = torch.ones(scene.images.shape[1:3])
    rows = [
        measure_quality(
            [Rendering(shown, *[whole] * 3)], scene.cameras, [photograph], {"psnr": psnr}, tmp_path
        )[0]
        for shown in (color, wrong)
    ]
    assert rows[0] == rows[1]
    assert rows[0][0]["psnr"] == pytest.approx(20, abs=1e-4)


def test_a_view_whose_mask_leaves_no_pixel_is_left_out_with_a_warning(tmp_path, caplog):
    """Its PSNR was no number, and the stage failed."""
    scene = painted_plane(3)
    alpha = torch.full((*scene.images.shape[1:3], 1), 255, dtype=torch.uint8)
    masked = [torch.cat([scene.images[k], alpha * (k != 1)], dim=2) for k in (0, 1)]
    cameras, images = views_that_count(scene.cameras, [*masked, scene.images[2]])
    assert [camera.name for camera in cameras] == ["0", "2"]
    assert [message.split(": ")[-1] for message in caplog.messages] == ["1"]
    whole = torch.ones(scene.images.shape[1:3])
    renders = [Rendering(image[..., :3] / 255 * 0.9, *[whole] * 3) for image in images]
    rows, means = measure_quality(renders, cameras, images, {"psnr": psnr}, tmp_path)
    assert [row["view"] for row in rows] == ["0", "2"]
    assert means["psnr"] == pytest.approx(np.mean([row["psnr"] for row in rows]))


def test_without_any_view_that_counts_quality_is_refused(tmp_path):
    with rejects("the held-out views", "masks"):
        measure_quality([], [], [], {"psnr": psnr}, tmp_path)
