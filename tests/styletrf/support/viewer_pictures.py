"""Pictures of a page and of the CPU."""

import numpy as np
import torch

from styletrf.field.appearance import ColorModel
from styletrf.field.kernels import kernels_for
from styletrf.field.rendering import render_view
from styletrf.field.view_rays import ViewRays
from styletrf.psnr import bounded_psnr
from styletrf.stylization.mixed_appearance import MixedAppearance
from styletrf.viewer.viewer_content import RENDER

CPU = torch.device("cpu")


LOOKS = [  # a, b, share of b, split
    (0, 1, 0.0, -1),
    (1, 0, 0.0, -1),
    (2, 0, 0.0, -1),
    (1, 2, 0.5, -1),
    (1, 0, 0.4, -1),
    (1, 2, 1.0, -1),
    (1, 2, 0.3, 0.5),
]


PICTURES = """
  const { scene, renderer } = await viewer;
  const shot = (each) => { renderer.draw(each); return renderer.read().map((v) => +v.toFixed(4)); };
  return { shots: CASES.map(shot) };
"""
CLICKS = """
  const { chosen, navigation, loop, renderer, picture } = await viewer;
  const find = (what) => document.querySelector(what), canvas = find("canvas"), sums = [];
  const pointer = (kind, x, y) => canvas.dispatchEvent(
    new PointerEvent(kind, { pointerId: 1, clientX: x, clientY: y, buttons: 1 }));
  const drag = (x, y) => {
    pointer("pointerdown", 100, 100);
    pointer("pointermove", 100 + x, 100 + y);
    pointer("pointerup", 100 + x, 100 + y);
  };
  const press = (key) => canvas.dispatchEvent(new KeyboardEvent("keydown", { key }));
  const look = async () => {
    await until(() => loop.isSettled());
    renderer.draw({ ...picture(32, 24), width: 32, height: 24 });
    sums.push(renderer.read().reduce((a, b) => a + b));
    loop.change();
  };
  await until(() => loop.isSettled());
  const begin = navigation.toText();
  drag(5, 3);
  const turned = navigation.toText();
  drag(5000, 3000);
  const far = navigation.toText();
  for (const radio of document.querySelectorAll("#looks input")) { radio.click(); await look(); }
  find("#share").value = 0.5;
  find("#share").dispatchEvent(new Event("input"));
  await look();
  find("#halve").click();
  await look();
  const isSplit = !find("#split").hidden;
  press("x"); press("2"); press("+");
  const zoomed = navigation.toText();
  find("#play").click();
  await until(() => chosen.frame > 0);
  find("#play").click();
  let saved = 0;
  HTMLAnchorElement.prototype.click = function () {
    saved += Boolean(this.download) && this.href.startsWith("blob:");
  };
  find("#save").click();
  await until(() => saved > 0);
  find("#reset").click();
  await until(() => location.hash.includes("view=") && loop.isSettled());
  return { begin, turned, far, zoomed, sums, isSplit, saved, over: overflow(), look: chosen.a,
           status: find("#status").textContent, end: navigation.toText() };
"""


class TwoColors(ColorModel):
    """The mean of two colors of each sample by their shares, of which one may be baked."""

    def __init__(self, one: ColorModel, other: ColorModel, fraction_of_other: float) -> None:
        super().__init__()
        self.both, self.fractions = (one, other), (1 - fraction_of_other, fraction_of_other)
        self.columns: list[int] = []

    def mean(self, values):
        return sum(fraction * value for fraction, value in zip(self.fractions, values, strict=True))

    def weight_powers(self, positions):
        return self.mean([each.weight_powers(positions) for each in self.both])

    def components(self, positions, kernels):
        parts = [each.components(positions, kernels) for each in self.both]
        self.columns = [part.shape[1] for part in parts]
        return torch.cat(parts, dim=1)

    def decode(self, components, view_directions, ray, kernels):
        parts = components.split(self.columns, dim=1)
        colors = [
            each.decode(part.contiguous(), view_directions, ray, kernels)
            for each, part in zip(self.both, parts, strict=True)
        ]
        return self.mean(colors)

    def background_color(self):
        return self.mean([each.background_color() for each in self.both])


def rendered(scene, baked, camera, a: int, b: int, fraction_b: float, split: float) -> np.ndarray:
    """What the CPU renders: of the photographs what is baked, of styles the fields themselves."""
    fields = list(scene.fields.values())
    appearances = [baked.looks[0].appearance(), *(field.appearance for field in fields[1:])]
    rays = ViewRays([camera], scene.model.space, fields[0].step_length, CPU)

    def mixed(fraction: float) -> np.ndarray:
        one, other = appearances[a], appearances[b]
        appearance = {0.0: one, 1.0: other}.get(fraction)
        if appearance is None:
            is_baked = 0 in (a, b)
            appearance = (
                TwoColors(one, other, fraction)
                if is_baked
                else MixedAppearance([one, other], [1 - fraction, fraction])
            )
        kernels = kernels_for(CPU)
        return render_view(fields[0], kernels, rays, 0, camera, RENDER, appearance).color.numpy()

    if split < 0:
        return mixed(fraction_b)
    left = (np.arange(camera.width) + 0.5 < split * camera.width)[None, :, None]
    return np.where(left, mixed(1.0), mixed(0.0))


def case(camera, a: int, b: int, fraction_b: float, split: float) -> dict:
    """The same for the page."""
    lens = {name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy")}
    view = {"pose": camera.world_from_camera.ravel().tolist(), **lens}
    size = {"width": camera.width, "height": camera.height}
    return {"view": view, "a": a, "b": b, "shareB": fraction_b, "split": split, **size}


def psnr(one: np.ndarray, other: np.ndarray) -> float:
    return bounded_psnr(float(np.square(one - other).mean()))
