"""Videos of a scene, and the frames of them that serve best as photographs.

Enters: clips. Leaves: chosen frames as a capture, and warnings about the clips.
Begin with `video_capture`; `frame_choice` and `frame_motion` decide.
"""
