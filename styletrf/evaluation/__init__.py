"""Measures of quality, consistency, style and cost, each beside its floor.

Enters: frames, their references, depths and cameras. Leaves: tables and summaries.
Begin with `quality` (fields), `consistency`, `stylization_loss` and
`resemblance.frame_resemblance` (stylized frames); time against accuracy is in `trade_off`.
"""
