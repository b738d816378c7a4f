"""Depths of the photographs' pixels, by comparing photographs with their neighbors.

Enters: cameras, images and sparse points. Leaves: a depth map for each photograph, with depths
where several photographs agree. Begin with `stereo_depths`.
"""
