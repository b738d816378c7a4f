"""The page itself: its HTML, style, scripts and shader, and the file that they become."""
