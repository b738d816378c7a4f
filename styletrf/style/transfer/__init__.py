"""Arbitrary style transfer (Ghiasi et al., BMVC 2017), which a training begins from.

Enters: the published ONNX files. Leaves: PyTorch modules with their weights.
Begin with `network`; `style_predictor` reads a painting's style, `weights` the files.
"""
