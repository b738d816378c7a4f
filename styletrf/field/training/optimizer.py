"""The optimizer of a fit: Adam, whose rates decay from an initial one for each group."""

import torch

from styletrf.field.radiance_field import RadianceField
from styletrf.field.training.config import FieldTrainingConfig


def optimizer_of(field: RadianceField, config: FieldTrainingConfig) -> torch.optim.Adam:
    """Returns an optimizer of a whole field, with rates for its factors and for its network."""
    factors = [*field.density.factors.parameters(), *field.appearance.factors.parameters()]
    groups = [
        {"params": factors, "initial_rate": config.factor_rate},
        {"params": field.appearance.network_parameters(), "initial_rate": config.network_rate},
    ]
    return torch.optim.Adam(groups, lr=0.0, betas=(0.9, 0.99), fused=True)


def take_step(optimizer: torch.optim.Adam, decay: float) -> None:
    """Takes a step down the gradients, at `decay` times the initial rates, and clears them."""
    for group in optimizer.param_groups:
        group["lr"] = group["initial_rate"] * decay
    optimizer.step()
    optimizer.zero_grad()
