"""The kernels for CUDA: Triton, float32.

`differentiable.CompiledBackend` documents the functions. The conformance suite checks that all
backends agree. Gradients of the factors are summed in an order that varies from run to run (see
`vm_triton`).
"""

from styletrf.field.kernels.composite_triton import (
    composite_backward,
    composite_forward,
    heavy_samples,
)
from styletrf.field.kernels.trace_triton import trace_backward, trace_forward
from styletrf.field.kernels.vm_triton import density_features, features_forward, scatter_gradients

__all__ = [
    "composite_backward",
    "composite_forward",
    "density_features",
    "features_forward",
    "heavy_samples",
    "scatter_gradients",
    "trace_backward",
    "trace_forward",
]
