"""What users bring: photographs, videos, panoramas, masks, and poses if they have them.

Enters: a scene's folder. Leaves: exact copies and `capture.json`, and the views that all
later stages read. Begin with `scene_capture` (photographs) or `clips.video_capture`.
"""
