"""RAFT as an estimator of flow: missing weights are an error; its images and flow are converted."""

import numpy as np
import pytest
import torch
from expected_errors import rejects

from styletrf.errors import InputError
from styletrf.evaluation import raft_flow
from styletrf.files.published_weights import RAFT


def test_missing_weights_are_reported(tmp_path):
    with pytest.raises(InputError) as caught:
        raft_flow.raft_estimator(folder=tmp_path)
    assert caught.value.subject in ("flow `raft`", str(tmp_path / RAFT))


def test_other_weights_than_those_named_are_refused(tmp_path):
    pytest.importorskip(
        "torchvision", reason="no torchvision (extra raft)", exc_type=(ImportError, RuntimeError)
    )
    (tmp_path / RAFT).write_bytes(b"other weights")
    with rejects(tmp_path / RAFT, "SHA-256"):
        raft_flow.raft_estimator(folder=tmp_path)


@pytest.mark.parametrize("size", [(128, 136), (90, 131)])
def test_the_network_sees_frames_in_its_range_and_size(monkeypatch, size):
    seen = []

    class Network(torch.nn.Module):
        def forward(self, a, b, updates):
            seen.extend([a, b])
            assert updates == 32
            return [torch.zeros(1, 2, *a.shape[2:]), torch.cat([a[:, :1], b[:, 1:2]], dim=1)]

    monkeypatch.setattr(raft_flow, "_network", lambda path: Network())
    random = np.random.default_rng(0)
    a, b = (random.random((*size, 3)).astype(np.float32) for _ in "ab")
    flow = raft_flow.raft_estimator(updates=32)(a, b)
    assert flow.shape == (*size, 2)
    assert flow[..., 0] == pytest.approx(2 * a[..., 0] - 1)
    assert flow[..., 1] == pytest.approx(2 * b[..., 1] - 1)
    for frame in seen:
        assert all(n % 8 == 0 and n >= 128 for n in frame.shape[2:])


def test_the_real_network_gives_a_finite_flow_of_the_size_of_the_images(monkeypatch):
    """Its weights, which nobody ships, are random here."""
    optical_flow = pytest.importorskip(
        "torchvision.models.optical_flow",
        reason="no torchvision (extra raft)",
        exc_type=(ImportError, RuntimeError),
    )
    network = optical_flow.raft_large(weights=None).eval()
    monkeypatch.setattr(raft_flow, "_network", lambda path: network)
    image = np.random.default_rng(0).random((120, 140, 3)).astype(np.float32)
    flow = raft_flow.raft_estimator()(image, image)
    assert flow.shape == (120, 140, 2)
    assert np.isfinite(flow).all()
