"""Measures of quality, consistency, style and cost, each beside its floor.

Enters: frames, their references, depths and cameras. Leaves: tables and summaries.
Begin with `quality`, `consistency` and `stylization_loss`; time against accuracy is in
`trade_off`.
"""
