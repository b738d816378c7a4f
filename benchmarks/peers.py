"""PSNR against wall time of nerfstudio's nerfacto, on the photographs and poses of our fit.

python3 -m venv DIR && DIR/bin/pip install torch==2.13.0 torchvision==0.28.0 nerfstudio==1.1.5
python benchmarks/peers.py horns --nerfstudio DIR/bin --folder OUT --minutes 2 5 10 30

Both have the photographs, poses and held-out views of `CameraPoses` at `draft`. nerfacto runs on
the CPU with its own settings, in its own environment. Its clock starts after ten steps, as that of
`field.py train` after the first. The latter prints the same of our fit, and with
`--kernels reference` of the reference backend.
"""

import argparse
import json
import os
import subprocess
import time
from pathlib import Path

from task_of import task_of

from pipeline.task import artifact
from styletrf.exports.camera_files import write_transforms
from styletrf.geometry.camera_table import read_split
from tasks.stages.scene import CameraPoses

TRAIN = (
    "--machine.device-type", "cpu", "--pipeline.model.implementation", "torch",
    "--mixed-precision", "False", "--vis", "tensorboard", "--max-num-iterations", "1000000",
    "--steps-per-save", "10", "--steps-per-eval-batch", "0", "--steps-per-eval-image", "0",
    "--steps-per-eval-all-images", "0", "--experiment-name", "peer", "--timestamp", "run",
)  # fmt: skip
OPERATORS = """
import torch
library = torch.library.Library("torchvision", "DEF")
for name in ("nms", "qnms"):
    library.define(name + "(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
"""
"""Declares what torchvision cannot load without CUDA; nerfacto calls none of it."""
ALEXNET = """
import sys, torchvision
torch.save(torchvision.models.alexnet().state_dict(), sys.argv[1])
"""
"""Random weights: nerfacto loads some for LPIPS, which is not used here, from the network."""
EVALUATION = """
import json, sys, torch
from pathlib import Path
from nerfstudio.utils.eval_utils import eval_setup
pipeline = eval_setup(Path(sys.argv[1]), test_mode="val")[1]
views, found = pipeline.datamanager.eval_dataset, []
with torch.no_grad():
    for k in range(len(views)):
        rays = views.cameras.generate_rays(camera_indices=k, keep_shape=True)[::4, ::4]
        shown = pipeline.model.get_outputs_for_camera_ray_bundle(rays)["rgb"]
        error = (shown - views.get_data(k)["image"][::4, ::4]).square().mean()
        found.append(-10 * float(torch.log10(error)))
values = {"psnr": sum(found) / len(found), "views": len(found)}
Path(sys.argv[2]).write_text(json.dumps(values))
"""
"""Of every fourth pixel along x and y: all take more than a quarter of an hour a checkpoint."""
RUN = Path("peer/nerfacto/run/nerfstudio_models")
DATA = ("nerfstudio-data", "--downscale-factor", "1", "--eval-mode", "filename")


def written_data(scene: str, folder: Path) -> Path:
    """Writes photographs and poses as nerfstudio reads them; returns the folder."""
    poses = artifact(task_of(CameraPoses, scene=scene, quality="draft"))
    frames = []
    for part, cameras in zip(("train", "eval"), read_split(poses / "cameras.parquet"), strict=True):
        (folder / part).mkdir(parents=True, exist_ok=True)
        for camera in cameras:
            image = folder / part / f"{part}_{camera.name}.png"
            image.unlink(missing_ok=True)
            image.symlink_to(poses / "images" / f"{camera.name}.png")
        write_transforms(folder / f"{part}.json", cameras, f"{part}/{part}_", ".png")
        frames += json.loads((folder / f"{part}.json").read_text())["frames"]
    for frame in frames:
        frame["file_path"] = frame["file_path"].replace("_/", "_")
    text = json.dumps({"camera_model": "OPENCV", "frames": frames})
    (folder / "transforms.json").write_text(text)
    return folder


def trained(nerfstudio: Path, data: Path, folder: Path, minutes: list[float]) -> list[Path]:
    """Trains nerfacto; returns its checkpoints of after so many minutes."""
    weights = folder / "hub/checkpoints/alexnet-owt-7be5be79.pth"
    weights.parent.mkdir(parents=True, exist_ok=True)
    subprocess.run([nerfstudio / "python", "-c", OPERATORS + ALEXNET, weights], check=True)
    words = ["nerfacto", *TRAIN, "--output-dir", folder, "--data", data, *DATA]
    text = OPERATORS + "from nerfstudio.scripts.train import entrypoint\nentrypoint()\n"
    command = [str(nerfstudio / "python"), "-c", text, *map(str, words)]
    process = subprocess.Popen(command, env=_environment(folder))
    try:
        _latest(process, folder / RUN)
        begun, kept = time.monotonic(), []
        for minute in sorted(minutes):
            time.sleep(max(0.0, begun + 60 * minute - time.monotonic()))
            latest = _latest(process, folder / RUN)
            kept.append(folder / f"after_{minute:g}" / latest.name)
            kept[-1].parent.mkdir(exist_ok=True)
            os.link(latest, kept[-1])
    finally:
        process.kill()
    return kept


def _environment(folder: Path) -> dict[str, str]:
    """Returns one without a GPU, where nerfstudio 1.1.5 may read its own checkpoints by pickle."""
    settings = {"CUDA_VISIBLE_DEVICES": "", "TORCH_FORCE_NO_WEIGHTS_ONLY_LOAD": "1"}
    return {**os.environ, **settings, "TORCH_HOME": str(folder)}


def _latest(process: subprocess.Popen[bytes], run: Path) -> Path:
    """Returns the run's checkpoint, once it has one: while another is written, there are two."""
    while len(found := list(run.glob("*.ckpt"))) != 1:
        if process.poll() is not None:
            raise SystemExit("nerfacto ended")
        time.sleep(0.1)
    return found[0]


def evaluated(nerfstudio: Path, folder: Path, checkpoint: Path) -> dict[str, float]:
    """Returns the steps of a checkpoint and the mean PSNR of the held-out views."""
    for other in (folder / RUN).glob("*.ckpt"):
        other.unlink()
    os.link(checkpoint, folder / RUN / checkpoint.name)
    config, report = (folder / RUN).parent / "config.yml", checkpoint.with_suffix(".json")
    command = [nerfstudio / "python", "-c", OPERATORS + EVALUATION, config, report]
    subprocess.run(list(map(str, command)), check=True, env=_environment(folder))
    steps = int(checkpoint.stem.removeprefix("step-"))
    return {"steps": steps, **json.loads(report.read_text())}


def main() -> None:
    """Prints a row for each time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene")
    parser.add_argument("--nerfstudio", type=Path, required=True)
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--minutes", type=float, nargs="+", default=[2.0, 5.0, 10.0, 30.0])
    options = parser.parse_args()
    data = written_data(options.scene, options.folder / "data")
    kept = trained(options.nerfstudio, data, options.folder, options.minutes)
    for minute, checkpoint in zip(sorted(options.minutes), kept, strict=True):
        row = {"minutes": minute, **evaluated(options.nerfstudio, options.folder, checkpoint)}
        print(json.dumps(row), flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
