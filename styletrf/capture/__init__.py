"""The input of users: photographs, videos, panoramas, masks, and poses if they have them.

Enters: a scene's folder. Leaves: exact copies and `capture.json`. Begin with `scene_capture`
    (photographs) or `clips.video_capture` (videos); later stages read undistorted photographs by
    `views`.
"""
