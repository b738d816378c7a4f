"""Pairs of nearby renders of a scene, with the exact flow between them, as content to train on."""

from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from styletrf.errors import InputError
from styletrf.files.float_images import read_float_image
from styletrf.geometry.camera_table import read_cameras
from styletrf.geometry.exact_flow import exact_flow
from styletrf.style.training.temporal_loss import ContentPair

_FARTHEST = 5  # frames apart
_TOLERANCE = 0.02  # of the depth, within which two renders show the same


class RenderPairs:
    """Renders along a path as endless pairs, of which the k-th depends on seed and k alone."""

    def __init__(self, folder: Path, *, batch: int, crop_px: int, seed: int) -> None:
        """Opens the renders along a path.

        Args:
            folder: What `write_float_frames` wrote.
            batch: Pairs at a time.
            crop_px: Side of the square window that both show; less where the renders are smaller.
            seed: Of the choice.

        Raises:
            InputError: There are fewer than two renders.
        """
        self._frames = folder / "frames"
        self._cameras = read_cameras(folder / "cameras.parquet")
        if len(self._cameras) < 2:
            raise InputError(str(folder), "has no two renders", "Render a longer trajectory")
        smallest = min(min(c.width, c.height) for c in self._cameras)
        self._batch, self._side, self._seed = batch, min(crop_px, smallest), seed

    def __call__(self, k: int) -> ContentPair:
        """Returns the k-th pairs."""
        rng = np.random.default_rng([self._seed, k, 2])
        pairs = [self._pair(rng) for _ in range(self._batch)]
        first, second, flow, valid = (torch.stack(part) for part in zip(*pairs, strict=True))
        return ContentPair(first, second, flow, valid)

    def _pair(self, rng: np.random.Generator) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        apart = int(rng.integers(1, min(_FARTHEST, len(self._cameras) - 1) + 1))
        index = int(rng.integers(len(self._cameras) - apart))
        cameras = [self._cameras[index], self._cameras[index + apart]]
        a, b = (read_float_image(self._frames / f"{c.name}.exr") for c in cameras)
        flow, valid = exact_flow(cameras[0], a.depth, cameras[1], b.depth, _TOLERANCE)
        top, left = (int(rng.integers(n - self._side + 1)) for n in a.depth.shape)
        window = (slice(top, top + self._side), slice(left, left + self._side))
        colors = [torch.from_numpy(i.color[window].clip(0, 1)).permute(2, 0, 1) for i in (a, b)]
        first, second = colors
        return (
            first,
            second,
            torch.from_numpy(flow[window]).float(),
            torch.from_numpy(valid[window]),
        )
