"""Equirectangular panoramas, cut into views of pinhole cameras.

Enters: photographs, some of which may be panoramas. Leaves: views and how they are turned.
Begin with `panoramas` (which are), then `panorama_views` (how they are cut) and
`panorama_capture` (the files).
"""
