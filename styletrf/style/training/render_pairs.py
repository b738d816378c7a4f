"""Pairs of nearby renders of a scene, with the exact flow between them, as content to train on."""

from collections.abc import Collection
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


def training_pairs(
    n_renders: int, measured: Collection[tuple[int, int]] = ()
) -> dict[int, list[int]]:
    """Returns the first renders of the pairs to train on, by how many renders they are apart.

    These are all pairs up to five renders apart but for those `measured`, by their indices in
    ascending order: no pair serves both training and measuring. A distance without a pair is left
    out.
    """
    firsts = {
        apart: [k for k in range(n_renders - apart) if (k, k + apart) not in measured]
        for apart in range(1, _FARTHEST + 1)
    }
    return {apart: found for apart, found in firsts.items() if found}


class RenderPairs:
    """Renders along a path as endless pairs, of which the k-th depends on seed and k alone."""

    def __init__(
        self,
        folder: Path,
        *,
        batch: int,
        crop_px: int,
        seed: int,
        measured: Collection[tuple[int, int]] = (),
    ) -> None:
        """Opens the renders along a path.

        Args:
            folder: The folder that `write_float_frames` wrote.
            batch: The number of pairs at a time.
            crop_px: The side of the square window that both show; less where the renders are
                smaller.
            seed: Decides the choice.
            measured: The pairs that are kept out, see `training_pairs`.

        Raises:
            InputError: There are fewer than two renders, or no pair is left.
        """
        self._frames = folder / "frames"
        self._cameras = read_cameras(folder / "cameras.parquet")
        if len(self._cameras) < 2:
            raise InputError(str(folder), "has no two renders", "Render a longer trajectory")
        self._firsts = training_pairs(len(self._cameras), frozenset(measured))
        if not self._firsts:
            problem = f"leaves no two of its {len(self._cameras)} renders that are not measured"
            remedy = "Render a longer trajectory, or lower `pairs` of ConsistencyMetrics"
            raise InputError("temporal_loss.renders", problem, remedy)
        smallest = min(min(c.width, c.height) for c in self._cameras)
        self._batch, self._side, self._seed = batch, min(crop_px, smallest), seed

    def __call__(self, k: int) -> ContentPair:
        """Returns the k-th pairs."""
        rng = np.random.default_rng([self._seed, k, 2])
        pairs = [self._pair(rng) for _ in range(self._batch)]
        first, second, flow, valid = (torch.stack(part) for part in zip(*pairs, strict=True))
        return ContentPair(first, second, flow, valid)

    def _pair(self, rng: np.random.Generator) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        apart = int(rng.choice(list(self._firsts)))
        index = int(rng.choice(self._firsts[apart]))
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
