"""Videos of a scene, and the frames of them that serve best as photographs.

Enters: clips, and masks of them. Leaves: chosen frames as a capture, and warnings about the clips.
Begin with `video_capture`; `frame_choice` and `frame_motion` decide.
"""
