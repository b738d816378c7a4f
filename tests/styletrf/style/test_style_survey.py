"""Warnings of a painting before it is learned."""

import logging
from pathlib import Path

import numpy as np
import pytest
import torch
from message_words import mentions

from styletrf.files.images import read_rgb, write_rgb
from styletrf.style.style_image import read_style_image
from styletrf.style.style_survey import gram_trace_ratio, painting_warnings, trace_warnings
from styletrf.synthetic.paintings import PAINTINGS

SHIPPED = Path(__file__).parents[3] / "data" / "styles"
RNG = np.random.default_rng(0)
GRAY = np.repeat(RNG.uniform(size=(300, 300, 1)), 3, axis=2).astype(np.float32)
FAINT = (0.5 + 0.02 * RNG.normal(size=(300, 300, 3))).clip(0, 1).astype(np.float32)
COLORFUL = RNG.uniform(size=(300, 300, 3)).astype(np.float32)


def test_a_painting_that_will_disappoint_has_the_warning_of_its_defect():
    plain = np.full((300, 300, 3), 0.25, dtype=np.float32)
    paintings = GRAY, FAINT, plain, COLORFUL[:100]
    (gray,), (faint,), (of_plain,), (small,) = map(painting_warnings, paintings)
    assert mentions(gray, "--colors")
    assert mentions(small, 100)
    assert faint == of_plain
    assert len({gray, faint, small}) == 3


@pytest.mark.parametrize("name", PAINTINGS)
def test_a_good_painting_has_no_warning(name):
    assert painting_warnings(read_rgb(SHIPPED / f"{name}.jpg")) == []


def test_the_warning_reaches_the_log(tmp_path, caplog):
    write_rgb(tmp_path / "gray.png", GRAY)
    with caplog.at_level(logging.WARNING):
        read_style_image(tmp_path / "gray.png")
    assert mentions(caplog.text, "gray.png", "--colors")


def test_the_trace_is_relative_to_the_content(vgg):
    content = torch.rand(3, 3, 32, 32, generator=torch.Generator().manual_seed(0))
    assert gram_trace_ratio(vgg, content[:1], content[:1]) == pytest.approx(1)
    bright = gram_trace_ratio(vgg, content[:1], 0.5 * content[:1])
    assert bright > 1.1
    assert trace_warnings(0.9) == []
    (warning,) = trace_warnings(3.5)
    assert mentions(warning, "3.5")
    assert np.isfinite(gram_trace_ratio(vgg, content[:1], torch.zeros(1, 3, 32, 32)))
