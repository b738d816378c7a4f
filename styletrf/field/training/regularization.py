"""Terms that make a fit prefer simple fields: L1 of the density, total variation of both grids.

L1 empties what no photograph shows; total variation (TensoRF section 4.1) smooths, and decays with
the learning rates, for it would blur in the end.
"""

from styletrf.field.radiance_field import RadianceField
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.schedule import decay


def add_regularization_gradient(
    field: RadianceField, config: FieldTrainingConfig, iteration: int, n_views: int
) -> None:
    """Adds the gradients of L1 and, decaying with the iterations, total variation.

    They are added every `config.tv_every` iterations, as many times as strong.

    Args:
        field: The field whose factors have gradients.
        config: The weights.
        iteration: The number of the iteration, from 0 on.
        n_views: The number of photographs, or of views cut from panoramas; where they are few,
            smoothness fills the parts that few see.
    """
    every = config.tv_every
    if iteration % every:
        return
    fading = every * decay(config.rate_decay, iteration, config.iterations)
    density, appearance = field.density.factors, field.appearance.factors
    density.add_l1_gradient(every * config.l1_weight)
    fading *= max(1.0, config.tv_views / n_views)
    density.add_total_variation_gradient(fading * config.tv_density)
    appearance.add_total_variation_gradient(fading * config.tv_appearance)
