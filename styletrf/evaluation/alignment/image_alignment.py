"""Finds the pose of a photograph by comparing it with renders (direct image alignment).

A camera that moves by the twist (v, w) in its own frame, T' = T exp(v, w), shows at a pixel p

    R'(p) = R(p) + grad R(p) . J(X) (v + w x X),        J = d project / dX,

to first order, with X the point that p shows (Lucas and Kanade 1981; Engel et al. 2018, section
2.2). Each step renders color and depth once, brings the render to the photograph's exposure by a
gain and an offset for each channel, and solves the weighted normal equations for the twist. Coarse
to fine: blurred images of a few dozen pixels first, for their slopes reach further.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float

from styletrf.field.rendering import Rendering
from styletrf.geometry.cameras import Camera, directions_of_all_pixels, fitted_to

Image = Float[np.ndarray, "height width 3"]
Values = Float[np.ndarray, "height width ..."]
Mask = Bool[np.ndarray, "height width"]
Render = Callable[[Camera], Rendering]

LONG_SIDES_PX = (48, 96, 192)
_STEPS = 12  # at each size
_LEAST_RISE = 1e-5  # of the correlation, for another step
_BLUR_PX = 1.0
_DETAIL_PX = 3.0  # standard deviation of the blur; an image minus its blur is its detail
_DAMPING = 1e-3  # of the diagonal of the normal equations
_ROBUST = 2.0  # median errors, from which on a pixel weighs less
_LEAST_OPACITY = 0.5  # of a pixel whose depth is used
_ALL_OF_A_PIXEL = 1 - 1e-6  # of a reduced mask: above, all of a pixel counts, but for rounding


@dataclass(frozen=True, slots=True)
class Alignment:
    """A pose, and how alike photograph and render are there.

    Attributes:
        camera: Moved from where the search began.
        correlation: That of the blurred images at the last size, from -1 to 1.
        detail: The same of detail finer than a few pixels: photographs of different things agree
            in light and ground, never in detail.
    """

    camera: Camera
    correlation: float
    detail: float


def aligned(
    camera: Camera,
    photograph: Image,
    render: Render,
    long_sides: Sequence[int] = LONG_SIDES_PX,
    counts: Mask | None = None,
) -> Alignment:
    """Returns the camera moved to where renders look most like the photograph.

    Args:
        camera: The camera of the photograph, at a pose from which the search begins.
        photograph: RGB in [0, 1], at the camera's size.
        render: Renders the scene from a camera, in the camera's world.
        long_sides: The image sizes to align at, coarse to fine.
        counts: The pixels of the photograph that are compared; None for all. Where reduced images
            have none that sees these alone, the camera stays.
    """
    found = Alignment(camera, 0.0, 0.0)
    for long_side in sorted(long_sides):
        sized = at_pose_of(fitted_to(camera, long_side), found.camera)
        found = _aligned_at(sized, _Target.of(photograph, sized, counts), render)
    return replace(found, camera=at_pose_of(camera, found.camera))


def _aligned_at(camera: Camera, target: "_Target", render: Render) -> Alignment:
    """Returns the alignment at the size of the camera."""
    if not target.counts.any():
        return Alignment(camera, 0.0, 0.0)
    best = _Match.of(camera, target, render)
    for _ in range(_STEPS):
        found = _Match.of(_stepped(best, target), target, render)
        if found.correlation <= best.correlation + _LEAST_RISE:
            break
        best = found
    return Alignment(best.camera, best.correlation, best.detail(target))


def at_pose_of(camera: Camera, other: Camera) -> Camera:
    """Returns the camera, with its own lens, at the pose of another."""
    return replace(camera, world_from_camera=other.world_from_camera)


@dataclass(frozen=True, slots=True)
class _Target:
    """A photograph at the size of a camera, blurred, and its pixels that are compared."""

    image: Image
    counts: Mask

    @classmethod
    def of(cls, photograph: Image, camera: Camera, counts: Mask | None = None) -> "_Target":
        image = reduced(photograph, camera)
        if counts is None:
            return cls(image, np.ones(image.shape[:2], dtype=bool))
        return cls(image, reduced(counts.astype(np.float64), camera) > _ALL_OF_A_PIXEL)

    def correlation(self, image: Image, target: Image) -> float:
        """Returns the correlation of two images over the pixels that are compared."""
        return correlation(image[self.counts], target[self.counts])


@dataclass(frozen=True, slots=True)
class _Match:
    """A render beside the photograph, brought to its exposure."""

    camera: Camera
    image: Image
    depth: Float[np.ndarray, "height width"]
    correlation: float

    @classmethod
    def of(cls, camera: Camera, target: _Target, render: Render) -> "_Match":
        shown = render(camera)
        image = _exposed(_blurred(shown.color.numpy().astype(np.float64)), target)
        depth = shown.median_depth.numpy().astype(np.float64)
        depth = np.where(shown.opacity.numpy() >= _LEAST_OPACITY, depth, np.inf)
        return cls(camera, image, depth, target.correlation(image, target.image))

    def detail(self, target: _Target) -> float:
        """Returns the correlation of the details that are finer than a few pixels."""
        return target.correlation(_detail(self.image), _detail(target.image))


def correlation(image: Float[np.ndarray, "... 3"], target: Float[np.ndarray, "... 3"]) -> float:
    """Returns the correlation of colors, each channel about its mean; 0 of flat ones."""
    pixels = (values.reshape(-1, 3) for values in (image, target))
    a, b = (values - values.mean(axis=0) for values in pixels)
    norm = np.sqrt((a**2).sum() * (b**2).sum())
    return float((a * b).sum() / norm) if norm > 0 else 0.0


def likeness(camera: Camera, photograph: Image, render: Render, long_side: int) -> float:
    """Returns the `detail` of an alignment for a camera whose pose is known."""
    sized = fitted_to(camera, long_side)
    target = _Target.of(photograph, sized)
    return _Match.of(sized, target, render).detail(target)


def reduced(image: Values, camera: Camera) -> Float[np.ndarray, "rows columns ..."]:
    """Returns the image at the camera's size, blurred by a pixel."""
    size = camera.width, camera.height
    return _blurred(cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.float64))


def _blurred(image: Values) -> Values:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), _BLUR_PX, borderType=cv2.BORDER_REPLICATE))


def _detail(image: Image) -> Image:
    smooth = cv2.GaussianBlur(image, (0, 0), _DETAIL_PX, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(image - smooth)


def _exposed(image: Image, target: _Target) -> Image:
    """Returns the image with the gain and offset for each channel that bring it near the target."""
    seen, wanted = image[target.counts], target.image[target.counts]
    mean, level = seen.mean(axis=0), wanted.mean(axis=0)
    covariance = ((seen - mean) * (wanted - level)).mean(axis=0)
    gain = covariance / np.maximum(seen.var(axis=0), 1e-6)
    return np.asarray((image - mean) * np.clip(gain, 0.25, 4.0) + level)


def _stepped(match: _Match, target: _Target) -> Camera:
    """Returns the camera after one weighted Gauss-Newton step; no step without depth."""
    is_there = np.isfinite(match.depth)
    used = (is_there & target.counts).reshape(-1)
    if not used.any():
        return match.camera
    scale = float(np.median(match.depth[is_there]))
    slopes = _slopes(match, target.image)[used]
    motion = _pixel_motion(match, scale)[used]
    jacobian = np.einsum("pcx,pxk->pck", slopes, motion).reshape(-1, 6)
    error = (target.image - match.image).reshape(-1, 3)[used].reshape(-1)
    least = _ROBUST * float(np.median(np.abs(error))) + 1e-9
    weight = least / np.maximum(np.abs(error), least)
    normal = (jacobian * weight[:, None]).T @ jacobian
    normal += _DAMPING * np.diag(np.diag(normal)) + 1e-12 * np.eye(6)
    twist = np.linalg.solve(normal, (jacobian * weight[:, None]).T @ error)
    return _moved(match.camera, twist[:3] * scale, twist[3:])


def _slopes(match: _Match, target: Image) -> Float[np.ndarray, "pixels 3 2"]:
    """Returns the mean gradient of render and photograph (efficient second-order, Malis 2004)."""
    middle = (match.image + target) / 2
    down, right = np.gradient(middle, axis=(0, 1))
    return np.stack([right, down], axis=-1).reshape(-1, 3, 2)


def _pixel_motion(match: _Match, scale: float) -> Float[np.ndarray, "pixels 2 6"]:
    """Returns d pixel / d twist of the points shown, translations in units of `scale`."""
    camera = match.camera
    x, y, _ = directions_of_all_pixels(camera).T
    inverse = scale / match.depth.reshape(-1)
    zero = np.zeros_like(x)
    return np.stack(
        [
            camera.fx * np.stack([inverse, zero, -x * inverse, -x * y, 1 + x * x, -y], axis=-1),
            camera.fy * np.stack([zero, inverse, -y * inverse, -1 - y * y, x * y, x], axis=-1),
        ],
        axis=1,
    )  # fmt: skip


def _moved(camera: Camera, velocity: np.ndarray, spin: np.ndarray) -> Camera:
    """Returns the camera moved by a translation and a rotation in its own frame."""
    rotation = camera.world_from_camera[:, :3]
    center = camera.center_world + rotation @ velocity
    turned = rotation @ cv2.Rodrigues(spin)[0]
    return replace(camera, world_from_camera=np.column_stack([turned, center]))
