"""What a command shows on its terminal while builds run.

Enters: progress that builds report by the protocol `Progress`, and log records. Leaves: a progress
bar, or one live line for each of several builds, and the lines of a log; to luigid, percentages.
Begin at `display.py`, which chooses among them. No artifact depends on this package.
"""
