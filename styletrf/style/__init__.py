"""The painting, and the network that learns it (Johnson, Alahi and Fei-Fei, ECCV 2016).

Enters: a style image, content photographs, weights of VGG16. Leaves: a style network.
Begin with `style_network`, then `training.trainer`; the loss is in `perceptual`, the network
that a training begins from in `transfer`.
"""
