"""All toys as one package of tasks, whose commands `toy_commands.py` begins and ends."""

import os

import build_toys
import store_toys

from pipeline.command import take_over_luigi
from pipeline.console import display

__all__ = ["build_toys", "store_toys"]

if seconds := os.environ.get("TOYS_SECONDS_BETWEEN_REPORTS"):
    display._SECONDS_BETWEEN_REPORTS = float(seconds)
take_over_luigi("toy_commands")
