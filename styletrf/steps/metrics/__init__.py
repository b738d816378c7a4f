"""The steps that measure: a field on held-out photographs, and stylized frames.

Enters: folders of a field, of frames, of the painting. Leaves: `summary.json` and tables.
Begin with `quality` (of a field), then `consistency` (of frames). `frame_reader` reads the frames
for `resemblance` and `stylization_loss`.
"""
