"""The weight of the content follows the content term."""

import math

import pytest
import torch

from styletrf.style.perceptual.perceptual_loss import PerceptualLossConfig, PerceptualTerms
from styletrf.stylization.content_constraint import ConstrainedContentLoss, ContentConstraintConfig

CONFIG = ContentConstraintConfig(level=math.expm1(0.5), rate=0.8, least_factor=0.1)
GENERATOR = torch.Generator()
IMAGE = torch.zeros(1, 3, 4, 4)


class Terms:
    """A loss whose unweighted content term is given; style and total variation are 2 and 3."""

    def __init__(self, found, weight=1.5):
        self.found, self.weight = found, weight

    def content_features(self, shown):
        return shown

    def __call__(self, output, content, generator):
        content, style, tv = (torch.tensor(x) for x in (self.weight * self.found, 2.0, 3.0))
        return PerceptualTerms(content, style, tv, torch.tensor(0.0), torch.tensor(0.0))


def constrained(terms, config=CONFIG, *, relative=True):
    return ConstrainedContentLoss(
        terms, PerceptualLossConfig(content_weight=terms.weight, relative=relative), config
    )


def factors_of(loss, calls):
    found = []
    for _ in range(calls):
        loss(IMAGE, IMAGE, GENERATOR)
        found.append(loss.factor)
    return found


def test_the_weight_falls_while_less_content_is_lost_than_may_be():
    assert factors_of(constrained(Terms(0.3)), 1) == [pytest.approx(math.exp(-0.8 * 0.2))]
    assert factors_of(constrained(Terms(0.5)), 3) == pytest.approx([1, 1, 1])


def test_the_factor_of_the_content_rises_again_when_more_is_lost_up_to_its_start():
    terms = Terms(0.3)
    loss = constrained(terms)
    fallen = factors_of(loss, 3)[-1]
    terms.found = 0.7
    assert factors_of(loss, 1) == [pytest.approx(fallen * math.exp(0.8 * 0.2))]
    assert factors_of(loss, 9)[-1] == 1


@pytest.mark.parametrize("found", [0.0, 60.0, 1e30])
def test_the_factor_of_the_content_stays_within_its_limits(found):
    assert factors_of(constrained(Terms(found)), 40)[-1] == pytest.approx(1 if found > 0.5 else 0.1)


def test_the_total_has_the_content_by_the_weight_of_now():
    loss = constrained(Terms(0.3))
    assert float(loss(IMAGE, IMAGE, GENERATOR)) == pytest.approx(1.5 * 0.3 + 5)
    factor = loss.factor
    assert float(loss(IMAGE, IMAGE, GENERATOR)) == pytest.approx(factor * 1.5 * 0.3 + 5)


def test_a_term_that_yields_to_its_weight_comes_to_the_level():
    terms = Terms(0.35)
    loss = constrained(terms)
    for _ in range(200):
        loss(IMAGE, IMAGE, GENERATOR)
        terms.found = 0.7 / (1 + loss.factor)
    assert terms.found == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize(
    "loss",
    [
        constrained(Terms(0.1), ContentConstraintConfig(rate=0.0)),
        constrained(Terms(0.1, weight=0.0)),
        constrained(Terms(0.1), relative=False),
    ],
    ids=["rate of 0", "no content", "not relative"],
)
def test_the_weight_stays_where_it_cannot_follow(loss):
    assert factors_of(loss, 3) == [1, 1, 1]


@pytest.mark.parametrize(
    "wrong", [{"level": 0.0}, {"rate": -1.0}, {"least_factor": 0.0}, {"least_factor": 2.0}]
)
def test_a_setting_of_the_constraint_out_of_range_is_refused(wrong):
    with pytest.raises(ValueError, match="{} is {}".format(*next(iter(wrong.items())))):
        ContentConstraintConfig(**wrong)
