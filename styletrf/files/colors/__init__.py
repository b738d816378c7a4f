"""Conversions between the colors of files and those of this project, sRGB."""
