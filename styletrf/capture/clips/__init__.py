"""Videos of a scene, and the frames of them that serve best as photographs.

Enters: clips. Leaves: chosen frames as a capture, and what a person should know of the clip.
Begin with `video_capture`; `frame_choice` and `frame_motion` decide.
"""
