"""Measures, by means unseen in training, whether frames resemble the painting and show the scene.

Enters: frames, the painting, renders of the scene. Leaves: distances of colors, texture,
Gram matrices and features. Begin with `frame_resemblance`.
"""
