"""The identity of a task's code: a digest of everything in the project that its `build` can reach.

Input: a task's class. Output: one digest, which changes with the code and not with its comments.
Begin at `closure.py`, which follows names through modules that `source.py` parses. `snapshot.py`
reads the committed digests of all families. `adoption.py` declares that an edit changed no result.
"""
