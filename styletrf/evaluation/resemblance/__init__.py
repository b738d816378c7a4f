"""Whether frames look like the painting and still show the scene, by measures unseen in training.

Enters: frames, the painting, renders of the scene. Leaves: distances of colors, texture,
Gram matrices and features. Begin with `frame_resemblance`.
"""
