"""The content photographs that a style network is trained on.

Enters: a folder, a zip, COCO annotations, or nothing. Leaves: shards of small JPEGs and an
endless stream of batches of crops. Begin with `content_images`, then `content_batches`.
"""
