"""Conversions between the colors of files and those of this project, sRGB.

Enters: a frame of an HDR video, 16 bits a channel. Leaves: the same in sRGB, 8 bits a channel.
Begin with `high_dynamic_range`.
"""
