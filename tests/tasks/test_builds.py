"""Each stage on the mini scene: what it leaves is whole and keeps the stage's promise."""

import json
import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from message_words import mentions
from safetensors.torch import load_file

from styletrf.capture.capture_file import Capture, Photograph, write_capture
from styletrf.field.radiance_field import load_field
from styletrf.field.rendering import RenderConfig
from styletrf.files.float_images import read_float_image
from styletrf.files.images import read_rgb, write_rgb
from styletrf.files.tables import read_rows, read_summary, write_summary
from styletrf.files.video_frames import video_info
from styletrf.geometry.camera_table import read_cameras, read_split, write_cameras
from styletrf.scene.exposures import Exposure
from styletrf.scene.scene_model import read_scene_model, write_scene_model
from styletrf.style.style_network import load_style_network, stylize
from styletrf.style.transfer.weights import load_style_transfer
from styletrf.trajectory.frames import rendered
from tasks.presets.presets import PRESETS

Mini = Callable[[str], Path]


def test_scene_capture_keeps_the_bytes_of_the_photographs(mini: Mini, photographs: Path):
    kept = mini("SceneCapture") / "images"
    for path in (photographs / "scenes/mini/images").iterdir():
        assert (kept / path.name).read_bytes() == path.read_bytes()


def test_scene_model_says_what_it_decided_from_and_reads_back(mini: Mini, tmp_path: Path):
    path = mini("SceneModel") / "scene.json"
    model = read_scene_model(path)
    assert model.space.kind == "ndc"
    assert {"space", "near_far", "resolution"} <= set(model.evidence)
    write_scene_model(tmp_path / "again.json", model)
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()


def test_scene_report_says_what_a_field_costs_here(mini: Mini):
    folder = mini("SceneReport")
    summary = read_summary(folder / "summary.json")
    assert set(summary["seconds"]) == set(PRESETS)
    assert summary["expected_psnr"]["paper"] is None
    assert all(seconds > 0 for seconds in summary["seconds"].values())
    page = (folder / "report.html").read_text()
    assert mentions(page, "4 of 4")
    assert page.count('class="camera') == 2 * 4


def test_a_viewer_shows_the_photographs_and_every_style(mini: Mini):
    page = (mini("Viewer") / "viewer.html").read_text(encoding="utf-16")
    scene = json.loads(page.partition('id="scene">')[2].partition("</script>")[0])
    assert [look["name"] for look in scene["looks"]] == ["Photographs", "p"]
    assert all(look["thumbnail"].startswith("data:image/jpeg") for look in scene["looks"])
    assert len(scene["path"]) == 7
    assert read_rgb(mini("Viewer") / "p.jpg").size > 0


def test_radiance_field_learns_and_loads(mini: Mini):
    field = load_field(mini("RadianceField"))
    assert all(torch.isfinite(p).all() for p in field.parameters())
    assert field.density.occupancy.any()


def test_renders_are_float_images_with_depth_and_a_video(mini: Mini):
    folder = mini("TrajectoryFrames")
    cameras = read_cameras(folder / "cameras.parquet")
    assert len(cameras) == 7
    for camera in cameras:
        image = read_float_image(folder / "frames" / f"{camera.name}.exr")
        assert image.color.shape == (16, 16, 3)
        assert (image.depth > 0).all()
    assert video_info(folder / "video.mp4").frames == 7


def test_frames_say_how_well_photographs_support_them(mini: Mini):
    support = read_summary(mini("TrajectoryFrames") / "support.json")
    assert support["path"] == "auto"
    assert 0 <= support["unsupported"] <= 1
    assert len(support["frames"]) == 7
    assert [trial["unsupported"] for trial in support["tried"]][-1] >= support["unsupported"]


def test_a_path_that_no_photographs_support_is_made_of_stills(mini: Mini):
    limits = {"support.most_unsupported": 0.0, "support.least_for_stills": 0.0}
    settings = {"trajectory.frames": 24, **limits}
    folder = mini("TrajectoryFrames", settings=settings)
    support, frames = (
        read_summary(folder / "support.json"),
        read_cameras(folder / "cameras.parquet"),
    )
    assert [still["first_frame"] for still in support["stills"]] == [0, 12]
    assert support["tried"], "stills are the last resort"
    assert support["reason"]
    poses = [frame.world_from_camera for frame in frames]
    assert np.unique(poses, axis=0).shape[0] == 2
    assert video_info(folder / "video.mp4").frames == 24


def test_another_path_has_its_own_frames(mini: Mini):
    folder = mini("TrajectoryFrames", path="dolly", seconds=0.5, frame_rate=30, frame_size=64)
    cameras = read_cameras(folder / "cameras.parquet")
    assert [(camera.width, camera.height) for camera in cameras] == [(64, 64)] * 15
    assert video_info(folder / "video.mp4").frames_per_second == 30
    assert read_summary(folder / "support.json")["path"] == "dolly"
    assert read_float_image(folder / "frames" / "0000.exr").color.shape == (64, 64, 3)


def test_frames_that_are_not_enlarged_have_the_size_of_the_photographs(mini: Mini):
    settings = {"trajectory.frames": 2, "long_side_px": 64, "enlarged": False}
    cameras = read_cameras(mini("TrajectoryFrames", settings=settings) / "cameras.parquet")
    assert {(camera.width, camera.height) for camera in cameras} == {(16, 16)}


def test_priors_of_a_path_that_goes_elsewhere_show_what_it_sees(mini: Mini, tmp_path: Path):
    """No candidate does, so views along the path are among them; all are of one size."""
    aside = {"position": [1.5, 0, 2.5], "look_at": [1.5, 0, 4], "fov_deg": 30}
    file = tmp_path / "aside.json"
    file.write_text(json.dumps({"key_frames": [aside, aside | {"position": [1.7, 0, 2.5]}]}))
    frames = read_cameras(mini("TrajectoryFrames", path=str(file)) / "cameras.parquet")
    priors = read_cameras(mini("PriorRenders", path=str(file)) / "cameras.parquet")
    assert {(prior.width, prior.height) for prior in priors} == {(16, 16)}
    centers = np.stack([frame.center_world for frame in frames])
    nearest = [np.linalg.norm(centers - prior.center_world, axis=1).min() for prior in priors]
    assert min(nearest) < 1e-9


def test_style_image_is_read_whole(mini: Mini, photographs: Path):
    ours = read_rgb(mini("StyleImage") / "style.png")
    np.testing.assert_array_equal(ours, read_rgb(photographs / "styles/p.png"))


def test_embedded_content_holds_the_photographs_of_the_scene(mini: Mini):
    assert read_summary(mini("ContentImages") / "content.json")["count"] == 8


def test_perceptual_weights_are_stored_once_converted(mini: Mini, perceptual_file: Path):
    ours = load_file(mini("PerceptualWeights") / "vgg16.safetensors")
    theirs = load_file(perceptual_file)
    assert all(torch.equal(ours[name], tensor) for name, tensor in theirs.items())


def test_transfer_weights_paint_in_the_style_of_a_painting(mini: Mini):
    transfer = load_style_transfer(mini("TransferWeights"))
    painting = torch.from_numpy(read_rgb(mini("StyleImage") / "style.png"))
    painted = stylize(transfer.network_for(painting), torch.rand(18, 23, 3))
    assert painted.shape == (18, 23, 3)


def test_style_network_paints_at_the_size_it_is_given(mini: Mini):
    network = load_style_network(mini("StyleNetwork"))
    with torch.no_grad():
        assert network(torch.rand(1, 3, 18, 23)).shape == (1, 3, 18, 23)
    assert len(read_rows(mini("StyleNetwork") / "curve.parquet")) == 2


def test_every_prior_is_painted(mini: Mini):
    painted = sorted(path.stem for path in (mini("StylizedPriors") / "frames").iterdir())
    cameras = read_cameras(mini("PriorRenders") / "cameras.parquet")
    assert painted == [camera.name for camera in cameras]


def test_adaptation_changes_the_appearance_and_no_bit_of_the_density(mini: Mini):
    """StyleTRF's claim: geometry is that of the photographs."""
    plain = load_field(mini("RadianceField"))
    styled = load_field(mini("RadianceField"), mini("StylizedField"))
    for name, tensor in plain.density.state_dict().items():
        assert torch.equal(tensor, styled.density.state_dict()[name]), name
    lattices = [field.appearance.factors.resolution for field in (plain, styled)]
    assert lattices[0] < lattices[1], "strokes are finer than the photographs' appearance"
    assert styled.config.shading == "plain"
    assert not (mini("StylizedField") / "density.safetensors").exists()


def test_the_curve_of_a_stylization_goes_on_from_all_iterations_of_its_first_part(mini: Mini):
    """Four of them have no point of their own."""
    rows = read_rows(mini("StylizedField") / "curve.parquet")
    assert [row["iteration"] for row in rows] == [5, 6]


def test_stylized_frames_follow_the_trajectory(mini: Mini):
    frames = sorted((mini("StylizedFrames") / "frames").glob("*.png"))
    assert len(frames) == 7
    assert video_info(mini("StylizedFrames") / "video.mp4").frames == 7


def test_quality_is_measured_on_the_view_held_out(mini: Mini):
    rows = read_rows(mini("QualityMetrics") / "views.parquet")
    assert [row["view"] for row in rows] == ["0"]
    summary = read_summary(mini("QualityMetrics") / "summary.json")
    assert read_summary(mini("QualityMetrics") / "placed.json") == {}, "all have a camera"
    assert summary["psnr"] == pytest.approx(rows[0]["psnr"])
    assert math.isfinite(summary["ssim"])


def test_model_and_field_are_the_same_whatever_the_view_held_out_shows(
    stage_of, build, mini_poses: Path, tmp_path: Path
):
    poses = tmp_path / "poses"
    shutil.copytree(mini_poses, poses)
    noise = np.random.default_rng(1).random((16, 16, 3)).astype(np.float32)
    write_rgb(poses / "images" / "0.png", noise)
    cameras = read_cameras(poses / "cameras.parquet")
    farther = cameras[0].world_from_camera - [0, 0, 0, 2.0]
    cameras[0] = replace(cameras[0], world_from_camera=farther)
    write_cameras(poses / "cameras.parquet", cameras, held_out={"0"})
    left = []
    for given in (mini_poses, poses):
        model = build(stage_of("SceneModel")[0], poses=given)
        field = build(stage_of("RadianceField")[0], poses=given, model=model)
        files = model / "scene.json", *sorted(field.glob("*.safetensors"))
        left.append([path.read_bytes() for path in files])
    assert left[0] == left[1]


def test_exposures_of_the_model_are_taken_out_of_the_fit_and_given_back_to_measure(
    stage_of, build, tmp_path: Path
):
    stage, inputs = stage_of("RadianceField")
    model = read_scene_model(inputs["model"] / "scene.json")
    brighter = Exposure((0.3,) * 3, (1.0,) * 3)
    exposed = replace(model, exposures=dict.fromkeys("123", brighter))
    write_scene_model(tmp_path / "scene.json", exposed)
    field = build(stage, **{**inputs, "model": tmp_path})
    judge, judged = stage_of("QualityMetrics")
    folder = build(judge, **{**judged, "model": tmp_path, "field": field})
    summary = read_summary(folder / "summary.json")
    assert summary["psnr_exposed"] > summary["psnr"] + 1
    assert "psnr_exposed" not in read_summary(build(judge, **judged) / "summary.json")


def test_a_photograph_without_a_camera_is_placed_if_the_field_shows_the_same(
    stage_of, build, tmp_path: Path
):
    judge, inputs = stage_of("QualityMetrics")
    poses = tmp_path / "poses"
    shutil.copytree(inputs["poses"], poses)
    table = poses / "cameras.parquet"
    cameras, names = read_cameras(table), {camera.name for camera in read_split(table)[1]}
    lost = next(camera for camera in cameras if camera.name not in names)
    others = [camera for camera in cameras if camera is not lost]
    write_cameras(table, others, ["foreign", "lost"], names)
    model, field = read_scene_model(inputs["model"] / "scene.json"), load_field(inputs["field"])
    at = model.normalized([lost], max(lost.width, lost.height))
    seen = next(rendered(field, model.space, at, RenderConfig(), torch.device("cpu")))
    noise = np.random.default_rng(0).random(seen.color.shape, dtype=np.float32)
    images = {"lost": seen.color.numpy(), "foreign": noise}
    for name, image in images.items():
        write_rgb(poses / "images" / f"{name}.png", image)
    lens = {"camera_model": "PINHOLE", "camera_params": [lost.fx, lost.fy, lost.cx, lost.cy]}
    size = {"width": lost.width, "height": lost.height}
    write_summary(poses / "poses.json", lens | size)
    photographs = (Photograph(n, f"{n}.png", **size, size_bytes=0, sha256="") for n in images)
    write_capture(poses, Capture(tuple(photographs), ()))
    folder = build(judge, **{**inputs, "poses": poses, "capture": poses})
    placed = read_summary(folder / "placed.json")
    assert placed.keys() == images.keys()
    assert placed["lost"]["detail"] > placed["lost"]["needed"] >= 0.5
    assert np.shape(placed["lost"]["world_from_camera"]) == (3, 4)
    assert placed["foreign"]["detail"] < placed["foreign"]["needed"]
    assert "world_from_camera" not in placed["foreign"]


def test_consistency_has_a_row_a_pair(mini: Mini):
    rows = read_rows(mini("ConsistencyMetrics") / "pairs.parquet")
    assert [row["delta"] for row in rows] == [1] * 6 + [5] * 2


def test_style_is_measured_with_the_priors_where_there_are_any(mini: Mini):
    rows = read_rows(mini("StyleMetrics") / "frames.parquet")
    assert len(rows) == 6
    summary = read_summary(mini("StyleMetrics") / "summary.json")
    ratio = summary["style_swd_patches"] / summary["style_swd_patches_unstylized"]
    assert summary["style_swd_patches_ratio"] == pytest.approx(ratio)
    assert summary["sharpness_to_priors"] is not None
    by_frame = read_summary(mini("StyleMetrics", method="per-frame") / "summary.json")
    assert by_frame["sharpness_to_priors"] is None
