"""A library that knows which process imported it."""

import os
import sys
from pathlib import Path

IMPORTED_BY = os.getpid()


def repeat() -> int:
    """Writes which process imported it, and what it reads."""
    importer = "itself" if os.getpid() == IMPORTED_BY else "server"
    sys.stdout.write(f"{importer} {sys.stdin.read()}")
    return 0


def say_hello() -> int:
    """Writes a greeting."""
    sys.stdout.write("hello")
    return 0


def say_where() -> int:
    """Writes the working folder."""
    sys.stdout.write(str(Path.cwd()))
    return 0


def fail() -> int:
    """Writes a part of an answer, and fails."""
    sys.stdout.write("he")
    sys.stdout.flush()
    raise ValueError("as any function may")


def end() -> int:
    """Says that it failed, by its status alone."""
    return 3
