"""A running mean of parameters, which lies nearer to the minimum than where noisy steps end.

    mean_n = mean_{n-1} + max(1 / n, 1 / window) (p_n - mean_{n-1})

That is the plain mean of the first `window` values and an exponential one from then on (averaging
of iterates, Polyak and Juditsky 1992). The gradients of a fit are those of a few rays, so the
parameters wander around the minimum as far as the learning rate lets them.
"""

import torch
from torch import Tensor, nn


class ParameterAverage:
    """The running mean of a module's parameters, by their names.

    Attributes:
        count: The number of averaged values.
        mean: The mean of each parameter; empty before the first value.
    """

    def __init__(self, window: float) -> None:
        self._least_fraction = 1 / max(window, 1.0)
        self.count = 0
        self.mean: dict[str, Tensor] = {}

    @torch.no_grad()
    def add(self, module: nn.Module) -> None:
        """Adds the present values of the module's parameters to the mean."""
        self.count += 1
        fraction = max(1 / self.count, self._least_fraction)
        for name, value in module.named_parameters():
            if name in self.mean:
                self.mean[name].lerp_(value, fraction)
            else:
                self.mean[name] = value.clone()

    @torch.no_grad()
    def copy_to(self, module: nn.Module) -> None:
        """Sets the module's parameters to their means; without any values they stay."""
        for name, value in module.named_parameters():
            value.copy_(self.mean.get(name, value))
