"""What stops a fit whose values are no longer finite."""

import re

import pytest

from styletrf.errors import NotFiniteError


def stops(stage: str, tensor: str, where: str):
    message = re.escape(f"{stage}: {tensor} is not finite {where}")
    return pytest.raises(NotFiniteError, match=f"^{message}$")
