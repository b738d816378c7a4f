"""VGG16 and the perceptual loss: content, Gram matrices, total variation.

Enters: images and weights from one of three sources. Leaves: features and the loss's terms.
Begin with `perceptual_loss`.
"""
