"""The terminal of a command while builds run.

Input: the progress of builds (protocol `Display`), and log records. Output: a progress bar, or one
live line for each of several builds, and the lines of a log; for luigid, percentages.
Begin at `display.py`, which chooses among them. No artifact depends on this package.
"""
