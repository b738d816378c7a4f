"""VGG16 and the perceptual loss: content, style as Gram matrices or distributions, total variation.

Enters: images and weights from one of three sources. Leaves: features and the loss's terms.
Begin with `style_loss`, which brings `perceptual_loss`, `sliced_features` and `predictor_features`
together for one painting.
"""
