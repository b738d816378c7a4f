"""The code of the project: its identity, and other interpreters that find it.

Input: a task's class. Output: a digest of everything in the project that its `build` can reach,
which changes with the code and not with its comments.
Begin at `closure.py`, which follows names through modules that `source.py` parses. `snapshot.py`
reads the committed digests of all families. `adoption.py` declares that an edit changed no result.
`interpreters.py` runs functions in interpreters that find the modules of this one.
"""
