"""Fitting a field to photographs (TensoRF section 4), coarse to fine.

Enters: cameras, photographs and the scene's model. Leaves: a `RadianceField` and its curve.
Begin with `trainer`; the settings are in `config`, the growth of the grid in `schedule`, the terms
beside the colors in `regularization`, `distortion` and `observed_depths`, and the average of the
last parameters in `parameter_average`.
"""
