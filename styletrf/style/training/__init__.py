"""Training of a style network: one pass over content photographs per style.

Enters: content batches, a painting, renders in pairs. Leaves: a network and its curve.
Begin with `trainer`; one iteration is in `step`, all weights of the loss in `config`.
"""
