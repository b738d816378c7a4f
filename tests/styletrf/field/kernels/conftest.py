"""Tests of kernels compute on all cores, which would show a race."""

import pytest


@pytest.fixture(autouse=True)
def _on_all_cores(all_cores: None) -> None:
    """See `all_cores`."""
