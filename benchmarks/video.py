"""Poses of a hand-held clip of the courtyard against its true cameras.

    video.py film walk.mp4
    video.py poses walk.mp4 [--every 2] [--photographs] [--set tracks=600]

`film` writes the clip and, beside it, the true cameras of its frames: the walk of
`styletrf.synthetic.courtyard` at an even pace, once around, with a rest of five seconds after a
third and a swing aside after two thirds. The hand shakes by about half a degree; while the shutter
is open for 1/60 s the view turns, which blurs the picture; the sensor adds noise. `poses` solves
the poses of all frames and compares them with the true ones; as photographs, the frames do not know
their times. `poses` prints seconds of the processor, and those that passed.
"""

import argparse
import json
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np
from tqdm import tqdm
from truth import agreement

from styletrf.capture.capture_file import Capture, Photograph, write_capture
from styletrf.files.images import write_png
from styletrf.files.video import write_video
from styletrf.files.video_frames import timed_frames
from styletrf.geometry.camera_table import read_cameras, write_cameras
from styletrf.geometry.cameras import Camera
from styletrf.sfm.camera_poses import CameraPosesConfig, solve_camera_poses
from styletrf.synthetic.courtyard import CourtyardConfig, render_view
from styletrf.synthetic.courtyard.paths import walk_poses

SHUTTER_S = 1 / 60
REST_S, SWING_S = 5.0, 2.0
NOISE = 2.0  # of 255


class _Steady(np.random.Generator):
    """In place of a random generator: the path as it is meant, without its jitter."""

    def uniform(self, *args: Any) -> np.ndarray:  # type: ignore[override]
        return np.zeros(args[2])

    def normal(self, *args: Any) -> np.ndarray:  # type: ignore[override]
        return np.zeros(args[2])


def shake(time_s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Returns three smooth, unrelated motions with a standard deviation of one."""
    frequencies_hz = rng.uniform(0.3, 4.0, (3, 12))
    weights = frequencies_hz**-0.7
    weights /= np.sqrt((weights**2).sum(axis=1, keepdims=True) / 2)
    phases = rng.uniform(0, 2 * np.pi, (3, 12))
    waves = np.sin(2 * np.pi * time_s[:, None, None] * frequencies_hz + phases)
    return (weights * waves).sum(axis=-1)


def hand_held(time_s: np.ndarray, seconds: float, seed: int) -> np.ndarray:
    """Returns world_from_camera at each time of the clip."""
    rng = np.random.default_rng(seed)
    rest, swing = seconds / 3, 2 * seconds / 3
    walked_s = time_s - np.clip(time_s - rest, 0, REST_S)
    steps = 20000
    dense = walk_poses(steps, _Steady(np.random.PCG64()))
    index = np.minimum((walked_s / (seconds - REST_S) * steps).astype(int), steps - 1)
    poses = dense[index].copy()
    angles = np.radians(0.5) * shake(time_s, rng)
    within = np.clip((time_s - swing) / SWING_S, 0, 1)
    angles[:, 1] += np.radians(35) * np.sin(np.pi * within) ** 2
    turned = [cv2.Rodrigues(angle)[0] for angle in angles]
    poses[:, :, :3] = poses[:, :, :3] @ np.stack(turned)
    poses[:, :, 3] += 0.01 * shake(time_s, rng)
    return poses


def exposed(pose: np.ndarray, later: np.ndarray, config: CourtyardConfig, seed: int) -> np.ndarray:
    """Returns a frame: what turns past while the shutter is open, and noise."""
    width, height = config.width, config.height
    focal = 0.85 * width
    image = render_view(
        Camera("", width, height, focal, focal, width / 2, height / 2, pose), config
    )[0]
    lens = np.array([[focal, 0, width / 2 - 0.5], [0, focal, height / 2 - 0.5], [0, 0, 1]])
    turn, _ = cv2.Rodrigues(later[:, :3].T @ pose[:, :3])
    reach = float(np.linalg.norm(turn)) * focal
    parts = []
    for fraction in np.linspace(0, 1, max(1, min(32, round(reach)))) - 0.5:
        moved = lens @ cv2.Rodrigues(fraction * turn)[0] @ np.linalg.inv(lens)
        parts.append(
            cv2.warpPerspective(
                image.astype(np.float32), moved, (width, height), borderMode=cv2.BORDER_REPLICATE
            )
        )
    light = np.mean(parts, axis=0) if reach > 0.5 else image.astype(np.float32)
    noise = np.random.default_rng(seed).normal(0, NOISE, light.shape)
    return np.clip(np.rint(light + noise), 0, 255).astype(np.uint8)


def film(path: Path, seconds: float, rate: float, config: CourtyardConfig, threads: int) -> None:
    """Writes the clip and, beside it, the true cameras of its frames as `NAME.parquet`."""
    time_s = np.arange(round(seconds * rate)) / rate
    poses = hand_held(time_s, seconds, config.seed)
    later = hand_held(time_s + SHUTTER_S, seconds, config.seed)
    width, height, focal = config.width, config.height, 0.85 * config.width
    cameras = [
        Camera(f"{k}", width, height, focal, focal, width / 2, height / 2, pose)
        for k, pose in enumerate(poses)
    ]
    write_cameras(path.with_suffix(".parquet"), cameras)

    def frames() -> Iterator[np.ndarray]:
        """Renders the frames in order, several at a time."""
        with ThreadPoolExecutor(threads) as pool:
            render = partial(exposed, config=config)
            yield from tqdm(
                pool.map(lambda k: render(poses[k], later[k], seed=k), range(len(poses))),
                total=len(poses),
            )

    write_video(path, frames(), rate)


def captured(clip: Path, folder: Path, every: int, *, timed: bool) -> None:
    """Writes all or every so many frames of a clip as a capture."""
    (folder / "images").mkdir(parents=True)
    photographs = []
    for k, frame in enumerate(timed_frames(clip)):
        if k % every == 0:
            path = folder / "images" / f"{k:04d}.png"
            write_png(path, frame.pixels, compression=3)
            height, width = frame.pixels.shape[:2]
            place = (clip.name, 0, frame.time_s) if timed else (None, 0, None)
            photographs.append(Photograph(path.stem, path.name, width, height, 0, "", *place))
    write_capture(folder, Capture(tuple(photographs), ()))


def poses(clip: Path, every: int, config: CameraPosesConfig, *, timed: bool) -> None:
    """Prints how long the poses took and how far they are off."""
    with TemporaryDirectory() as folder:
        captured(clip, Path(folder) / "capture", every, timed=timed)
        out = Path(folder) / "out"
        out.mkdir()
        started_cpu, started = time.process_time(), time.monotonic()
        report = solve_camera_poses(Path(folder) / "capture", out, config)
        cpu_s, wall_s = time.process_time() - started_cpu, time.monotonic() - started
        ours = read_cameras(out / "cameras.parquet")
    truth = {camera.name: camera for camera in read_cameras(clip.with_suffix(".parquet"))}
    errors = agreement(ours, [truth[str(int(camera.name))] for camera in ours])
    print(  # noqa: T201
        f"{report.registered} of {report.total}, {report.matcher}, {report.verified_pairs} pairs,"
        f" {report.mapper} mapper, {report.matches_explained:.0%} explained,"
        f" {report.points} points, {cpu_s:.0f} CPU s, {wall_s:.1f} s",
        *(f"{name} {value:.4f}" for name, value in errors.items()),
        sep="\n  ",
    )


def main() -> None:
    """Films, or solves."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("action", choices=("film", "poses"))
    parser.add_argument("clip", type=Path, help="such as walk.mp4")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=1.0, help="frames a second")
    parser.add_argument("--width", type=int, default=1008)
    parser.add_argument("--height", type=int, default=756)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--photographs", action="store_true")
    parser.add_argument("--set", nargs="*", default=[], metavar="NAME=VALUE")
    given = parser.parse_args()
    if given.action == "film":
        config = CourtyardConfig("walk", 1, given.width, given.height, seed=given.seed)
        film(given.clip, given.seconds, given.rate, config, given.threads)
    else:
        values = {name: json.loads(value) for name, value in (s.split("=") for s in given.set)}
        settings = CameraPosesConfig(**values)
        poses(given.clip, given.every, settings, timed=not given.photographs)


if __name__ == "__main__":
    main()
