"""The page itself: its HTML, style, scripts and shader, and the file that they become.

Enters: a baked scene (`ViewerContent`) and its looks. Leaves: `viewer.html`, one file that needs no
network. Begin with `viewer_page`; `packed_scene` and `block_text` turn arrays into its text. In the
browser, `renderer.js` runs `march.glsl` on what `unpacking.js` reads.
"""
