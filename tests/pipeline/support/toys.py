"""All toys as one package of tasks, whose commands `toy_commands.py` begins and ends."""

import build_toys
import store_toys

from pipeline.command import take_over_luigi

__all__ = ["build_toys", "store_toys"]

take_over_luigi("toy_commands")
