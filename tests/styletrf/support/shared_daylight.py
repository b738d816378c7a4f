"""The daylight of the courtyard, which takes ten seconds, made once in a run."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import pytest
from shared_results import made_once

from styletrf.synthetic.courtyard import capture
from styletrf.synthetic.courtyard.shading import Surfaces


@contextmanager
def shared_daylight() -> Iterator[None]:
    """Workers share the lit courtyard while the block runs."""
    lit = capture.lit_courtyard

    @cache
    def shared(seed: int, *, glossy: bool, surround: bool = False) -> Surfaces:
        name = f"daylight {seed} {glossy} {surround}"
        return made_once(name, lambda: lit(seed, glossy=glossy, surround=surround))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(capture, "lit_courtyard", shared)
        yield
