"""A viewer in Chromium against the field's own renderer: size, PSNR, times, samples and fetches.

It shows each look, and of the photographs, the first painting and the second one halves of two at
each sample, and two beside each other.

python benchmarks/viewer.py horns mosaic udnie --quality draft

The stages are those of `luigi --module tasks Viewer` with the same words, which has to have run.
Without a graphics card Chromium draws on the CPU (SwiftShader).
"""

import argparse
import json
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from task_of import task_of

from pipeline.task import artifact
from styletrf.field.appearance import ColorModel
from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import RadianceField, load_field, load_stylized_field
from styletrf.field.rendering import render_view
from styletrf.field.view_rays import ViewRays
from styletrf.geometry.camera_table import read_cameras
from styletrf.geometry.cameras import Camera, resized
from styletrf.geometry.space import Space
from styletrf.psnr import bounded_psnr
from styletrf.scene.scene_model import read_scene_model
from styletrf.steps.viewer_page import PHOTOGRAPHS
from styletrf.stylization.mixed_appearance import MixedAppearance
from styletrf.viewer.viewer_content import RENDER
from tasks.results.viewer import Viewer

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/support"))
from headless import answer_of, page_text  # type: ignore[import-not-found]

CPU = torch.device("cpu")
VIEWS = 5
WATCH = """<script>
let first = 0;  // when the first picture was reported
new MutationObserver((_, watcher) => {
  if (!/ ms/.test(document.querySelector("#status")?.textContent)) return;
  first = performance.now();
  watcher.disconnect();
}).observe(document, { childList: true, subtree: true });
</script>"""
PROBE = """
  const loaded = performance.now(), { renderer } = await viewer, shots = [], ms = [];
  const ready = performance.now();
  await until(() => first);
  for (const each of CASES) {
    const begun = performance.now();
    renderer.draw(each);
    const colors = renderer.read();
    ms.push(performance.now() - begun);
    shots.push(colors.map((v) => +v.toFixed(5)));
  }
  return { shots, ms, loaded, first, ready };
"""
COUNTED = {  # in the shader, so that a pixel's color is how often its ray asks for each, over MOST
    "fragment = vec4(background, 1);": "fragment = vec4(0, 0, 0, 1); vec3 asked = vec3(0);",
    "uint empty = texelFetch(": "asked.x += 1.0; uint empty = texelFetch(",
    "float raw = lookup(": "asked.y += 1.0; float raw = lookup(",
    "sum += counted * colorAt(": "asked.z += 1.0; sum += counted * colorAt(",
    "if (kept > 0.0) fragment.rgb =": "fragment.rgb = asked / MOST; if (false) fragment.rgb =",
}
MOST = 2048.0


@dataclass(frozen=True)
class Shown:
    """What a page is to show: looks by their numbers in it.

    Attributes:
        a: The look of which there is 1 - fraction_b, and the only one to the right of the split.
        b: The other one.
        fraction_b: How much of it there is, where nothing is split.
        split: The fraction of the width that is to the left of the split; -1 without one.
    """

    a: int
    b: int
    fraction_b: float = 0.0
    split: float = -1.0


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene")
    parser.add_argument("styles", nargs="*")
    parser.add_argument("--quality", default="draft")
    parser.add_argument("--content", default="auto")
    parser.add_argument("--tuning", type=json.loads, default={})
    parser.add_argument("--long-side", type=int, default=504)
    given = parser.parse_args()
    words = {"scene": given.scene, "quality": given.quality, "content": given.content}
    viewer = task_of(Viewer, styles=given.styles, tuning=given.tuning, **words)
    inputs = {name: artifact(task) for name, task in viewer.requires().items()}
    page, space = artifact(viewer) / "viewer.html", read_scene_model(inputs["model"] / "scene.json")
    path = read_cameras(inputs["trajectory"] / "cameras.parquet")
    spread = np.linspace(0, len(path) - 1, VIEWS).round().astype(int)
    cameras = [sized(path[k], given.long_side) for k in spread]
    print(f"{page.stat().st_size / 1e6:.2f} MB")  # noqa: T201
    of, names = inputs["field"], [PHOTOGRAPHS, *given.styles]
    stylized = [load_stylized_field(of, inputs[f"stylized {name}"]) for name in given.styles]
    fields = [load_field(of), *stylized]
    for shown in all_shown(len(fields)):
        measure(page, shown, names, fields, space.space, cameras)


def sized(camera: Camera, long_side: int) -> Camera:
    """Returns a camera of larger or smaller pictures of the same view."""
    scale = long_side / max(camera.width, camera.height)
    return resized(camera, round(camera.width * scale), round(camera.height * scale))


def all_shown(looks: int) -> list[Shown]:
    """Returns each look, halves of two at each sample, and two beside each other."""
    pairs = [pair for pair in ((0, 1), (1, 2)) if max(pair) < looks]
    halves = [Shown(*pair, fraction_b=0.5) for pair in pairs]
    return [*(Shown(k, k) for k in range(looks)), *halves, *(Shown(*p, split=0.5) for p in pairs)]


def measure(
    page: Path, shown: Shown, names: list[str], fields: list[RadianceField], space: Space,
    cameras: list[Camera],
) -> None:  # fmt: skip
    """Prints the figures of one thing that is shown."""
    cases = [case(camera, shown) for camera in cameras]
    answer = answered(page, cases, {"<head>": "<head>" + WATCH})
    rays = ViewRays(cameras, space.within(fields[0].bounds), fields[0].step_length, CPU)
    found = []
    for k, (camera, shot) in enumerate(zip(cameras, answer["shots"], strict=True)):
        exact = picture(fields, shown, rays, k, camera)
        error = float(np.square(np.array(shot).reshape(exact.shape) - exact).mean())
        found.append(bounded_psnr(error))
    size = f"{cameras[0].width} x {cameras[0].height}"
    load, first, ready = (answer[name] / 1000 for name in ("loaded", "first", "ready"))
    seconds = f"first picture {first:.2f} s after opening, load event {load:.2f}, all {ready:.2f} s"
    psnr = f"{np.mean(found):.2f} dB (least {min(found):.2f})"
    times = f"{np.median(answer['ms']):.0f} ms a picture of {size}"
    asked = asked_in_words(page, cases)
    print(f"{in_words(shown, names)}: {psnr}, {times}, {seconds}, {asked}")  # noqa: T201


def answered(page: Path, cases: list[dict[str, Any]], replaced: dict[str, str]) -> dict[str, Any]:
    """Returns what a page with some texts replaced draws, and when."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "viewer.html"
        text = page_text(page)
        for old, new in replaced.items():
            if old not in text:
                raise SystemExit(f"{page} has no {old}")
            text = text.replace(old, new)
        copy.write_text(text, encoding="utf-16")
        probe = PROBE.replace("CASES", json.dumps(cases))
        answer: dict[str, Any] = answer_of(copy, probe, 1000, seconds=600)
    if answer["errors"]:
        raise SystemExit(answer["errors"])
    return answer


def in_words(shown: Shown, names: list[str]) -> str:
    """Returns what is shown."""
    if shown.a == shown.b:
        return names[shown.a]
    how = "beside" if shown.split >= 0 else "and half"
    return f"{names[shown.b]} {how} {names[shown.a]}"


def picture(
    fields: list[RadianceField], shown: Shown, rays: ViewRays, view: int, camera: Camera
) -> np.ndarray:
    """Returns what the CPU renders."""
    kernels, looks = kernels_for(CPU), [fields[k].appearance for k in (shown.a, shown.b)]

    def rendered(appearance: ColorModel) -> np.ndarray:
        with torch.no_grad():
            one = render_view(fields[0], kernels, rays, view, camera, RENDER, appearance)
        return one.color.numpy()

    if shown.split >= 0:
        left = (np.arange(camera.width) + 0.5 < shown.split * camera.width)[None, :, None]
        return np.where(left, rendered(looks[1]), rendered(looks[0]))
    if shown.fraction_b in (0, 1):
        return rendered(looks[round(shown.fraction_b)])
    return rendered(MixedAppearance(looks, [1 - shown.fraction_b, shown.fraction_b]))


def case(camera: Camera, shown: Shown) -> dict[str, Any]:
    """Returns what the page is to draw."""
    lens = {name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy")}
    view = {"pose": camera.world_from_camera.ravel().tolist(), **lens}
    looks = {"a": shown.a, "b": shown.b, "shareB": shown.fraction_b, "split": shown.split}
    return {"view": view, **looks, "width": camera.width, "height": camera.height}


def asked_in_words(page: Path, cases: list[dict[str, Any]]) -> str:
    """Returns how many voxels, densities and colors a ray asks for, in the mean of the pictures."""
    counted = {old: new.replace("MOST", str(MOST)) for old, new in COUNTED.items()}
    shots = answered(page, cases, {"<head>": "<head>" + WATCH, **counted})["shots"]
    voxels, densities, colors = MOST * np.mean([np.reshape(s, (-1, 3)).mean(0) for s in shots], 0)
    return f"a ray asks for {voxels:.1f} voxels, {densities:.1f} densities, {colors:.1f} colors"


if __name__ == "__main__":
    main()
